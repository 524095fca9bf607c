"""The solver's model and memory as compiled code sees them, from a row of numbers (``solver_row``)."""

import numpy as np
from numba import carray

from falsifier.fmu.c_functions import load_f8, load_i8, pointer
from falsifier.fmu.solver_memory import Memory, Model
from falsifier.fmu.solver_row import (
    COUNT,
    FUNCTIONS,
    GETTERS,
    HELD_PIECES,
    HELD_PORTS,
    INDICATORS,
    MAX_STEP,
    MEMORY,
    PIECES,
    PORTS,
    STATES,
    STOP_TIME,
    TOLERANCE,
    WEIGHTS,
)
from falsifier.fmu.stepping import compiled, four_numbers


@compiled
def _floats(row, column, size):  # type: ignore[no-untyped-def]
    return carray(pointer(load_i8(row + 8 * column)), (size,), np.float64)


@compiled
def _table(row, column, rows, size):  # type: ignore[no-untyped-def]
    return carray(pointer(load_i8(row + 8 * column)), (rows, size), np.float64)


@compiled
def _whole(row, column, size):  # type: ignore[no-untyped-def]
    return carray(pointer(load_i8(row + 8 * column)), (size,), np.int64)


@compiled
def model_of(row):  # type: ignore[no-untyped-def]
    """Return the model of a row."""
    f, count = row + 8 * FUNCTIONS, load_i8(row + 8 * COUNT)
    return Model(
        (
            load_i8(f), load_i8(f + 8), load_i8(f + 16), load_i8(f + 24), load_i8(f + 32), load_i8(f + 40),
            load_i8(f + 48), load_i8(f + 56), load_i8(f + 64), load_i8(f + 72), load_i8(f + 80),
        ),
        four_numbers(row + 8 * PORTS),
        four_numbers(row + 8 * HELD_PORTS),
        four_numbers(row + 8 * GETTERS),
        (load_i8(row + 8 * PIECES), count),
        (load_i8(row + 8 * HELD_PIECES), count),
        _floats(row, WEIGHTS, load_i8(row + 8 * STATES)),
        load_f8(row + 8 * TOLERANCE),
        load_f8(row + 8 * STOP_TIME),
        load_f8(row + 8 * MAX_STEP),
    )  # fmt: skip


@compiled
def memory_of(row, model):  # type: ignore[no-untyped-def]
    """Return the memory of a row with this model."""
    n, z, m = load_i8(row + 8 * STATES), load_i8(row + 8 * INDICATORS), MEMORY
    return Memory(
        _floats(row, m, 3),
        _whole(row, m + 1, 7),
        _whole(row, m + 2, model.ports[3] + model.held_ports[3]),
        _floats(row, m + 3, n),
        _floats(row, m + 4, n),
        _table(row, m + 5, 7, n),
        _table(row, m + 6, 4, n),
        _table(row, m + 7, n, n),
        _table(row, m + 8, n, n),
        _whole(row, m + 9, n),
        _floats(row, m + 10, z),
        _floats(row, m + 11, z),
        _table(row, m + 12, 3, z),
        carray(pointer(load_i8(row + 8 * (m + 13))), (64,), np.uint8),
    )
