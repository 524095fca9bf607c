"""The ways into the compiled loops: two functions of integers, whose machine code ``machine_code`` keeps.

They take what to do and the address of what it needs, so that they can be called without the compiler.
"""

import numpy as np
from numba import carray

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
from falsifier.fmu.stepping import co_simulate, compiled, enter_step_mode, fetch, put, read_row, write_row


@compiled
def _four(a):  # type: ignore[no-untyped-def]
    return load_i8(a), load_i8(a + 8), load_i8(a + 16), load_i8(a + 24)


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
        report = carray(pointer(load_i8(a + 248)), (3,), np.int64)
        co_simulate(
            _seven(a), _four(a + 56), (load_i8(a + 88), load_i8(a + 96)), _four(a + 104),
            (load_i8(a + 136), load_i8(a + 144)), load_i8(a + 152), load_i8(a + 160), _four(a + 168),
            load_i8(a + 200), load_i8(a + 208), load_f8(a + 256), load_i8(a + 216), load_i8(a + 224),
            load_i8(a + 232), load_i8(a + 240), report,
        )  # fmt: skip
        return 0
    if what == ENTER_STEP_MODE_FIRST:
        status, where = enter_step_mode(_seven(a))
        return np.int64(status) + (np.int64(where) << 32)
    if what == WRITE_ROW:
        return np.int64(write_row(load_i8(a), load_i8(a + 8), _four(a + 16), load_i8(a + 48)))
    if what == READ_ROW:
        row = load_i8(a + 48), load_i8(a + 56), load_i8(a + 64)
        return np.int64(read_row(load_i8(a), load_i8(a + 8), _four(a + 16), *row))
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
