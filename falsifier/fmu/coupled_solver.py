"""One model-exchange component of a system, integrated from one communication point to another.

The loops of coupled_stepping.py call ``integrate`` by its address, so that systems without such components
neither compile nor load the solver. A *solver* row of eight-byte numbers has the component's model and memory
(``continuous.Model`` and ``Memory``) as addresses and sizes.
"""

import numpy as np
from numba import carray, types

from falsifier.fmu.c_functions import load_i8, pointer, store_i8
from falsifier.fmu.continuous import copy
from falsifier.fmu.coupled_stepping import (
    BRING_BACK,
    EVENT_AND_SOLVE,
    KEEP,
)
from falsifier.fmu.loop_numbers import DONE, PIECE_BYTES, TERMINATED
from falsifier.fmu.solver import pass_event, proceed
from falsifier.fmu.solver_memory import EVENTS, JACOBIAN_KNOWN, TIME
from falsifier.fmu.solver_row import KEPT, SOLVER_ENDS, SOLVER_STATUS
from falsifier.fmu.solver_views import memory_of, model_of
from falsifier.fmu.stepping import compiled, rounding

_ARGUMENTS = (types.int64, types.float64, types.float64, types.int64)


@compiled
def integrate(row, start, end, what):  # type: ignore[no-untyped-def]
    """Integrate a component from one communication point to another, with the events on the way.

    Args:
        row: address of its solver row.
        start: start of the step in s.
        end: end of the step in s.
        what: SOLVE, EVENT_AND_SOLVE, KEEP or BRING_BACK.

    Returns:
        Where it stopped.
    """
    m = model_of(row)
    s = memory_of(row, m)
    if what in (KEEP, BRING_BACK):
        _move(m, s, load_i8(row + 8 * KEPT), what == KEEP)
        return DONE
    store_i8(row + 8 * SOLVER_ENDS, 0)
    s.clock[TIME] = start
    s.counts[EVENTS] = 0
    status, where = 0, DONE
    if what == EVENT_AND_SOLVE:
        status, where = pass_event(m, s)
    while where == DONE and end - s.clock[TIME] > rounding(end):
        status, where = proceed(m, s, end)
    if where == TERMINATED:
        store_i8(row + 8 * SOLVER_ENDS, 1)
        if end - s.clock[TIME] <= rounding(end):
            where = DONE
    store_i8(row + 8 * SOLVER_STATUS, status)
    return where


@compiled
def _move(m, s, kept, is_kept):  # type: ignore[no-untyped-def]
    """Copy what changes in a step to this address, or back; the rest follows from it."""
    at = _vector(s.clock, kept, is_kept)
    at = _vector(s.x, at, is_kept)
    at = _vector(s.stages[0], at, is_kept)
    at = _vector(s.z, at, is_kept)
    at = _lines(m.ports, m.pieces, at, is_kept)
    at = _lines(m.held_ports, m.held_pieces, at, is_kept)
    numbers = carray(pointer(at), (7 + s.piece.shape[0],), np.int64)
    for i in range(numbers.shape[0]):
        own, k = (s.counts, i) if i < 7 else (s.piece, i - 7)
        if is_kept:
            numbers[i] = own[k]
        else:
            own[k] = numbers[i]
    s.counts[JACOBIAN_KNOWN] = 0


@compiled
def _vector(own, at, is_kept):  # type: ignore[no-untyped-def]
    other = carray(pointer(at), own.shape, np.float64)
    if is_kept:
        copy(other, own)
    else:
        copy(own, other)
    return at + 8 * own.shape[0]


@compiled
def _lines(ports, pieces, at, is_kept):  # type: ignore[no-untyped-def]
    """Copy the first piece of each input, which is the line that a connected one follows."""
    for j in range(ports[3]):
        line = carray(pointer(pieces[0] + j * pieces[1] * PIECE_BYTES), (5,), np.float64)
        at = _vector(line, at, is_kept)
    return at


def kept_numbers(states: int, indicators: int, inputs: int) -> int:
    """Return how many eight-byte numbers are kept of a component."""
    return 3 + 2 * states + indicators + 5 * inputs + 7 + inputs


def address() -> int:
    """Compile ``integrate``, or load it from the cache, and return its address."""
    from numba.core.types.function_type import CompileResultWAP

    integrate.compile(_ARGUMENTS)
    return int(CompileResultWAP(integrate.overloads[_ARGUMENTS]).__wrapper_address__())
