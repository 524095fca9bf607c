"""Pieces of inputs and the rows of a run, without an FMU."""

import numpy as np
from numpy.typing import NDArray

from falsifier.core.signals import Signal
from falsifier.fmu.continuous import copy, enter_pieces, next_break
from falsifier.fmu.solver_memory import TIME, Memory, Model, make_memory

NOTHING = (0, 0, 0, 0)
STOP = 10.0


def driven(*signals: Signal, held: int = 0) -> tuple[Model, Memory, NDArray[np.float64]]:
    """A run whose last inputs change at events only; the table must outlive the model."""
    tables = [signal.pieces(STOP) for signal in signals]
    most = max(len(t) for t in tables)
    padded = np.full((len(tables), most, 5), np.inf)
    for row, table in zip(padded, tables, strict=True):
        row[: len(table)] = table
    first = len(signals) - held
    model = Model(
        functions=(0,) * 11,
        ports=(0, 0, 0, first),
        held_ports=(0, 0, 0, held),
        getters=NOTHING,
        pieces=(padded.ctypes.data, most),
        held_pieces=(padded[first:].ctypes.data if held else 0, most),
        weights=np.zeros(0),
        tolerance=1e-6,
        stop_time=STOP,
        max_step=1.0,
    )
    return model, make_memory(0, 0, len(signals)), padded


STEPS = Signal((0.0, 2.0, 5.0), (1.0, 3.0, 3.0), "constant")
RAMP = Signal((0.0, 4.0), (0.0, 1.0), "linear")


def test_the_next_break_is_the_earliest_of_any_input() -> None:
    model, memory, _table = driven(STEPS, RAMP)
    assert next_break(model, memory) == 2.0
    memory.clock[TIME] = 2.0
    assert enter_pieces(model, memory), "a step is a jump"
    assert memory.piece.tolist() == [1, 0]
    assert next_break(model, memory) == 4.0


def test_a_bend_is_no_jump_and_neither_is_a_step_of_no_height() -> None:
    model, memory, _table = driven(STEPS, RAMP)
    memory.piece[:] = 1, 0
    memory.clock[TIME] = 4.0
    assert not enter_pieces(model, memory)
    memory.clock[TIME] = 5.0
    assert not enter_pieces(model, memory)
    assert memory.piece.tolist() == [2, 1]


def test_behind_the_last_piece_there_is_no_break() -> None:
    model, memory, _table = driven(Signal((0.0,), (1.0,), "constant"))
    assert next_break(model, memory) == np.inf
    memory.clock[TIME] = STOP
    assert not enter_pieces(model, memory)


def test_several_pieces_are_passed_at_once_and_rounding_does_not_matter() -> None:
    model, memory, _table = driven(STEPS)
    memory.clock[TIME] = 5.0 - 1e-13
    enter_pieces(model, memory)
    assert memory.piece.tolist() == [2]


def test_inputs_that_change_at_events_only_always_ask_for_one() -> None:
    model, memory, _table = driven(RAMP, STEPS, held=1)
    memory.piece[:] = 0, 1
    memory.clock[TIME] = 5.0
    assert next_break(model, memory) == 4.0
    assert enter_pieces(model, memory), "although it has no height"
    assert memory.piece.tolist() == [1, 2]


def test_vectors_are_copied() -> None:
    target, source = np.zeros(3), np.array([1.0, 2.0, 3.0])
    copy(target, source)
    source[0] = 9.0
    assert target.tolist() == [1.0, 2.0, 3.0]
