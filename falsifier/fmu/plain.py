"""The loops of stepping.py without a compiler: slower by one to two orders of magnitude, equal in outcome.

They run where numba is not installed, and the tests compare the compiled loops with them.
"""

import ctypes
from collections.abc import Callable
from ctypes import c_double, c_int, c_size_t, c_uint8, c_void_p
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.fmu.ports import STORAGE, Table

DONE, SETTING, STEPPING, GETTING, EVENT, TERMINATED, STUCK = range(7)
STATUS, WHERE, STEP = range(3)
INSTANCE, DO_STEP, ENTER_EVENT_MODE, UPDATE_DISCRETE_STATES, ENTER_STEP_MODE, FMI_VERSION, EVENT_MODE = range(
    7
)

_MOST_ROUNDS = 1000
_C_TYPES = {
    "f8": ctypes.c_double,
    "f4": ctypes.c_float,
    **{f"i{n}": getattr(ctypes, f"c_int{8 * n}") for n in (1, 2, 4, 8)},
    **{f"u{n}": getattr(ctypes, f"c_uint{8 * n}") for n in (1, 2, 4, 8)},
}
Floats = NDArray[np.float64]


@lru_cache(maxsize=256)
def _function(address: int, *argument_types: Any) -> Callable[..., int]:
    return ctypes.CFUNCTYPE(c_int, c_void_p, *argument_types)(address)


def fetch(places: Table, j: int) -> float:
    """Variable j as a number, from where its call left it."""
    kind, address, sign, is_boolean = places[j].tolist()
    value = float(_C_TYPES[STORAGE[kind]].from_address(address).value)
    if is_boolean:
        return float((value != 0.0) == (sign > 0))
    return value * sign


def put(places: Table, j: int, number: float) -> None:
    """A number to where the call that sets variable j takes it; anything but floating point is rounded."""
    kind, address, sign, is_boolean = places[j].tolist()
    stored = STORAGE[kind]
    value = float((number >= 0.5) == (sign > 0)) if is_boolean else float(number) * sign
    _C_TYPES[stored].from_address(address).value = value if stored[0] == "f" else int(np.rint(value))


def exchange_values(instance: int, version: int, calls: Table) -> int:
    """Call the get or set functions of a table; the first status above warning ends it."""
    worst = 0
    for address, references, count, values, size in calls.tolist():
        if version == 3:
            five = _function(address, c_void_p, c_size_t, c_void_p, c_size_t)
            status = five(instance, references, count, values, size)
        else:
            status = _function(address, c_void_p, c_size_t, c_void_p)(instance, references, count, values)
        worst = max(worst, status)
        if status > 1:
            break
    return worst


def read_row(instance: int, version: int, calls: Table, places: Table, rows: Floats, column: int) -> int:
    """Read all variables of a table into one column of ``rows``."""
    status = exchange_values(instance, version, calls)
    if status <= 1:
        for j in range(len(places)):
            rows[j, column] = fetch(places, j)
    return status


def write_row(instance: int, version: int, calls: Table, places: Table, rows: Floats, column: int) -> int:
    """Set all variables of a table to one column of ``rows``."""
    for j in range(len(places)):
        put(places, j, float(rows[j, column]))
    return exchange_values(instance, version, calls)


def enter_step_mode(functions: Table) -> tuple[int, int]:
    """Leave the event mode that an FMI 3 FMU is in after its initialisation: status and where it stopped."""
    status, where = _settle_3(functions)
    if where == DONE:
        status = _function(int(functions[ENTER_STEP_MODE]))(int(functions[INSTANCE]))
        where = EVENT if status > 1 else DONE
    return status, where


def co_simulate(
    functions: Table, set_calls: Table, set_places: Table, event_calls: Table, event_places: Table,
    get_calls: Table, get_places: Table, pieces: Floats, event_pieces: Floats, current: Table, values: Floats,
    outputs: Floats, step: float, first: int, last: int, every: int, report: Table,
) -> None:  # fmt: skip
    """Do the communication steps first..last-1; see stepping.co_simulate."""
    instance, version = int(functions[INSTANCE]), int(functions[FMI_VERSION])
    report[:] = 0, DONE, first
    for k in range(first, last):
        report[STEP] = k
        if len(set_calls):
            _put_inputs(set_places, pieces, k * step)
            status = exchange_values(instance, version, set_calls)
            if status > 1:
                report[:2] = status, SETTING
                return
        if len(event_calls):
            new_values = _put_inputs(event_places, event_pieces, k * step)
            if k > 0 and (new_values != values[len(set_places) :]).any():
                status, where = _event_3(functions, event_calls)
                if where != DONE:
                    report[:2] = status, where
                    return
            values[len(set_places) :] = new_values
        status, where, ends = _advance(functions, version, k * step, (k + 1) * step, step, event_calls[:0])
        report[:2] = status, where
        if where != DONE:
            return
        report[STEP] = k + 1
        if (k + 1) % every == 0:
            status = read_row(instance, version, get_calls, get_places, outputs, (k + 1) // every)
            if status > 1:
                report[:2] = status, GETTING
                return
        if ends:
            report[WHERE] = TERMINATED
            return


def _put_inputs(places: Table, pieces: Floats, time: float) -> Floats:
    """Put all inputs of a table at a time into its buffers; returns their values."""
    values = np.zeros(len(places))
    for j in range(len(places)):
        begun = pieces[j, pieces[j, :, 0] <= time + 1e-11 * max(1.0, abs(time))]
        start, c0, c1, c2, c3 = begun[-1].tolist()
        dt = time - start
        values[j] = ((c3 * dt + c2) * dt + c1) * dt + c0
        put(places, j, float(values[j]))
    return values


def _advance(
    functions: Table, version: int, start: float, end: float, step: float, no_calls: Table
) -> tuple[int, int, bool]:
    """One communication step: status, where it stopped, and whether the FMU asked to end the simulation."""
    if version == 3:
        return _advance_3(functions, start, end, no_calls)
    last_type = c_int if version == 2 else c_uint8
    do_step = _function(int(functions[DO_STEP]), c_double, c_double, last_type)
    status = do_step(int(functions[INSTANCE]), start, step, 1)
    return status, STEPPING if status > 1 else DONE, False


def _advance_3(functions: Table, start: float, end: float, no_calls: Table) -> tuple[int, int, bool]:
    do_step = _function(
        int(functions[DO_STEP]), c_double, c_double, c_uint8, c_void_p, c_void_p, c_void_p, c_void_p
    )
    flags, reached = (c_uint8 * 3)(), c_double()
    a = ctypes.addressof(flags)
    time, rounds = start, 0
    while True:
        flags[:] = [0, 0, 0]
        status = do_step(
            int(functions[INSTANCE]), time, end - time, 1, a, a + 1, a + 2, ctypes.addressof(reached)
        )
        if status > 1:
            return status, STEPPING, False
        event, ends, early = map(bool, flags)
        before, time = time, (reached.value if early else end)
        if event and functions[EVENT_MODE] and not ends:
            status, where = _event_3(functions, no_calls)
            if where == TERMINATED:
                return status, DONE if time >= end else TERMINATED, True
            if where != DONE:
                return status, where, ends
        left = end - time
        if ends or left <= 1e-12 * max(1.0, abs(end)):
            return status, DONE if left <= 1e-9 * max(1.0, abs(end)) else TERMINATED, ends
        rounds = 0 if time > before else rounds + 1
        if rounds > _MOST_ROUNDS:
            return 0, STUCK, ends


def _event_3(functions: Table, discrete_calls: Table) -> tuple[int, int]:
    instance = int(functions[INSTANCE])
    status = _function(int(functions[ENTER_EVENT_MODE]))(instance)
    if status > 1:
        return status, EVENT
    status = exchange_values(instance, 3, discrete_calls)
    if status > 1:
        return status, SETTING
    status, where = _settle_3(functions)
    if where != DONE:
        return status, where
    status = _function(int(functions[ENTER_STEP_MODE]))(instance)
    return status, EVENT if status > 1 else DONE


def _settle_3(functions: Table) -> tuple[int, int]:
    update = _function(int(functions[UPDATE_DISCRETE_STATES]), *(c_void_p,) * 6)
    flags, next_time = (c_uint8 * 5)(), c_double()
    a = ctypes.addressof(flags)
    for _ in range(_MOST_ROUNDS):
        flags[0] = 0
        status = update(int(functions[INSTANCE]), a, a + 1, a + 2, a + 3, a + 4, ctypes.addressof(next_time))
        if status > 1:
            return status, EVENT
        if flags[1]:
            return status, TERMINATED
        if not flags[0]:
            return status, DONE
    return 0, STUCK
