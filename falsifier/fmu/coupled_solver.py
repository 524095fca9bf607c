"""One model-exchange component of a system, integrated from one communication point to another.

The loops of coupled_stepping.py call ``integrate`` by its address, so that systems without such components
neither compile nor load the solver. A *solver* row of eight-byte numbers has the component's model and memory
(``continuous.Model`` and ``Memory``) as addresses and sizes.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, types
from numba.extending import intrinsic

from falsifier.fmu.continuous import EVENTS, JACOBIAN_KNOWN, TIME, Memory, Model, copy
from falsifier.fmu.coupled_stepping import (
    BRING_BACK,
    EVENT_AND_SOLVE,
    KEEP,
    SOLVER_ENDS,
    SOLVER_STATUS,
)
from falsifier.fmu.solver import pass_event, proceed
from falsifier.fmu.stepping import (
    DONE,
    PIECE_BYTES,
    TERMINATED,
    compiled,
    load_f8,
    load_i8,
    rounding,
    store_i8,
)

# Columns of a solver row: the functions of the model, four addresses or sizes of each table of inputs, the
# addresses of their pieces, and sizes.
FUNCTIONS, PORTS, HELD_PORTS = 0, 11, 15
PIECES, HELD_PIECES, COUNT, STATES, INDICATORS = range(19, 24)
# The addresses of the weights, of the fields of Memory in their order, and of what is kept.
WEIGHTS, MEMORY, KEPT = 24, 25, 38
TOLERANCE, STOP_TIME, MAX_STEP = range(39, 42)
WIDTH = SOLVER_ENDS + 1

_ARGUMENTS = (types.int64, types.float64, types.float64, types.int64)


@intrinsic
def _pointer(_typing, address):  # type: ignore[no-untyped-def]
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.intp), emit


@compiled
def _floats(row, column, size):  # type: ignore[no-untyped-def]
    return carray(_pointer(load_i8(row + 8 * column)), (size,), np.float64)


@compiled
def _table(row, column, rows, size):  # type: ignore[no-untyped-def]
    return carray(_pointer(load_i8(row + 8 * column)), (rows, size), np.float64)


@compiled
def _whole(row, column, size):  # type: ignore[no-untyped-def]
    return carray(_pointer(load_i8(row + 8 * column)), (size,), np.int64)


@compiled
def _model(row):  # type: ignore[no-untyped-def]
    f, p, h = row + 8 * FUNCTIONS, row + 8 * PORTS, row + 8 * HELD_PORTS
    count = load_i8(row + 8 * COUNT)
    return Model(
        (
            load_i8(f), load_i8(f + 8), load_i8(f + 16), load_i8(f + 24), load_i8(f + 32), load_i8(f + 40),
            load_i8(f + 48), load_i8(f + 56), load_i8(f + 64), load_i8(f + 72), load_i8(f + 80),
        ),
        (load_i8(p), load_i8(p + 8), load_i8(p + 16), load_i8(p + 24)),
        (load_i8(h), load_i8(h + 8), load_i8(h + 16), load_i8(h + 24)),
        (0, 0, 0, 0),
        (load_i8(row + 8 * PIECES), count),
        (load_i8(row + 8 * HELD_PIECES), count),
        _floats(row, WEIGHTS, load_i8(row + 8 * STATES)),
        load_f8(row + 8 * TOLERANCE),
        load_f8(row + 8 * STOP_TIME),
        load_f8(row + 8 * MAX_STEP),
    )  # fmt: skip


@compiled
def _memory(row, inputs):  # type: ignore[no-untyped-def]
    n, z, m = load_i8(row + 8 * STATES), load_i8(row + 8 * INDICATORS), MEMORY
    return Memory(
        _floats(row, m, 3),
        _whole(row, m + 1, 7),
        _whole(row, m + 2, inputs),
        _floats(row, m + 3, n),
        _floats(row, m + 4, n),
        _table(row, m + 5, 7, n),
        _table(row, m + 6, 4, n),
        _table(row, m + 7, n, n),
        _table(row, m + 8, n, n),
        _whole(row, m + 9, n),
        _floats(row, m + 10, z),
        _floats(row, m + 11, z),
        carray(_pointer(load_i8(row + 8 * (m + 12))), (64,), np.uint8),
    )


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
    m = _model(row)
    s = _memory(row, m.ports[3] + m.held_ports[3])
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
    numbers = carray(_pointer(at), (7 + s.piece.shape[0],), np.int64)
    for i in range(numbers.shape[0]):
        own, k = (s.counts, i) if i < 7 else (s.piece, i - 7)
        if is_kept:
            numbers[i] = own[k]
        else:
            own[k] = numbers[i]
    s.counts[JACOBIAN_KNOWN] = 0


@compiled
def _vector(own, at, is_kept):  # type: ignore[no-untyped-def]
    other = carray(_pointer(at), own.shape, np.float64)
    if is_kept:
        copy(other, own)
    else:
        copy(own, other)
    return at + 8 * own.shape[0]


@compiled
def _lines(ports, pieces, at, is_kept):  # type: ignore[no-untyped-def]
    """Copy the first piece of each input, which is the line that a connected one follows."""
    for j in range(ports[3]):
        line = carray(_pointer(pieces[0] + j * pieces[1] * PIECE_BYTES), (5,), np.float64)
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
