"""The ways into the compiled loops: two functions of integers, whose machine code ``machine_code`` keeps.

They take what to do and the address of what it needs, so that they can be called without the compiler.
"""

import numpy as np
from numba import carray

from falsifier.fmu import loop_numbers as at
from falsifier.fmu.c_functions import load_f8, load_i8, pointer, store_f8
from falsifier.fmu.continuous import refresh, settle
from falsifier.fmu.loop_numbers import (
    ADVANCE,
    CO_SIMULATE,
    ENTER_STEP_MODE_FIRST,
    FETCH,
    PUT,
    READ_ROW,
    SETTLE,
    WRITE_ROW,
)
from falsifier.fmu.solver import advance
from falsifier.fmu.solver_row import OUTPUTS, SAMPLES, STEPS
from falsifier.fmu.solver_views import memory_of, model_of
from falsifier.fmu.stepping import (
    co_simulate,
    compiled,
    enter_step_mode,
    fetch,
    four_numbers,
    put,
    read_row,
    write_row,
)


@compiled
def _word(a, number):  # type: ignore[no-untyped-def]
    return load_i8(a + 8 * number)


@compiled
def _table(a, number):  # type: ignore[no-untyped-def]
    return four_numbers(a + 8 * number)


@compiled
def _pieces(a, number):  # type: ignore[no-untyped-def]
    return _word(a, number), _word(a, number + 1)


@compiled
def _seven(a):  # type: ignore[no-untyped-def]
    return (
        load_i8(a), load_i8(a + 8), load_i8(a + 16), load_i8(a + 24), load_i8(a + 32), load_i8(a + 40),
        load_i8(a + 48),
    )  # fmt: skip


def co_simulation(what, a):  # type: ignore[no-untyped-def]
    """Enter the loops of stepping.py; ``a`` is the address of the arguments that ``loops`` has packed.

    Returns:
        The FMI status, and in the upper 32 bits where it stopped.
    """
    if what == CO_SIMULATE:
        report = carray(pointer(_word(a, at.REPORT)), (3,), np.int64)
        co_simulate(
            _seven(a + 8 * at.FUNCTIONS), _table(a, at.PORTS), _pieces(a, at.PIECES),
            _table(a, at.HELD_PORTS), _pieces(a, at.HELD_PIECES), _word(a, at.CURRENT), _word(a, at.VALUES),
            _table(a, at.GETTERS), _word(a, at.OUTPUTS), _word(a, at.WIDTH), load_f8(a + 8 * at.STOP_TIME),
            _word(a, at.STEPS), _word(a, at.FIRST), _word(a, at.LAST), _word(a, at.EVERY), report,
        )  # fmt: skip
        return 0
    if what == ENTER_STEP_MODE_FIRST:
        status, where = enter_step_mode(_seven(a))
        return np.int64(status) + (np.int64(where) << 32)
    if what in (WRITE_ROW, READ_ROW):
        instance, version = _word(a, at.ROW_INSTANCE), _word(a, at.ROW_VERSION)
        ports, numbers = _table(a, at.ROW_PORTS), _word(a, at.ROW_NUMBERS)
        if what == WRITE_ROW:
            return np.int64(write_row(instance, version, ports, numbers))
        width, column = _word(a, at.ROW_LENGTH), _word(a, at.ROW_COLUMN)
        return np.int64(read_row(instance, version, ports, numbers, width, column))
    if what == PUT:
        put(load_i8(a), load_f8(a + 8))
    elif what == FETCH:
        store_f8(load_i8(a + 8), fetch(load_i8(a)))
    return 0


def model_exchange(what, row):  # type: ignore[no-untyped-def]
    """Enter the solver with a row of ``solver_row``; returns as ``co_simulation`` does."""
    m = model_of(row)
    s = memory_of(row, m)
    if what == ADVANCE:
        shape = m.getters[3], load_i8(row + 8 * SAMPLES)
        outputs = carray(pointer(load_i8(row + 8 * OUTPUTS)), shape, np.float64)
        status, where = advance(m, s, outputs, load_i8(row + 8 * STEPS))
    elif what == SETTLE:
        status, where = settle(m, s)
    else:
        status, where = refresh(m, s)
    return np.int64(status) + (np.int64(where) << 32)
