"""The loops of stepping.py without a compiler, in plain Python: what the compiled ones are compared with."""

import ctypes
from collections.abc import Callable
from ctypes import c_double, c_int, c_int64, c_size_t, c_uint8, c_void_p
from functools import lru_cache
from typing import Any

import numpy as np

from falsifier.fmu.ports import Addresses
from falsifier.fmu.process.encoding import STORAGE

DONE, SETTING, STEPPING, GETTING, EVENT, TERMINATED, STUCK = range(7)
STATUS, WHERE, STEP = range(3)
INSTANCE, DO_STEP, ENTER_EVENT_MODE, UPDATE_DISCRETE_STATES, ENTER_STEP_MODE, FMI_VERSION, EVENT_MODE = range(
    7
)
CALL_BYTES, PLACE_BYTES, PIECE_BYTES = 40, 32, 40

_MOST_ROUNDS = 1000
_C_TYPES = {
    "f8": ctypes.c_double,
    "f4": ctypes.c_float,
    **{f"i{n}": getattr(ctypes, f"c_int{8 * n}") for n in (1, 2, 4, 8)},
    **{f"u{n}": getattr(ctypes, f"c_uint{8 * n}") for n in (1, 2, 4, 8)},
}
Functions = tuple[int, ...]
Pieces = tuple[int, int]


@lru_cache(maxsize=256)
def _function(address: int, *argument_types: Any) -> Callable[..., int]:
    return ctypes.CFUNCTYPE(c_int, c_void_p, *argument_types)(address)


def _integers(address: int, count: int) -> list[int]:
    return list((c_int64 * count).from_address(address))


def _floats(address: int, count: int) -> list[float]:
    return list((c_double * count).from_address(address))


def fetch(place: int) -> float:
    """A variable as a number, from where its call left it."""
    kind, address, sign, is_boolean = _integers(place, 4)
    value = float(_C_TYPES[STORAGE[kind]].from_address(address).value)
    if is_boolean:
        return float((value != 0.0) == (sign > 0))
    return value * sign


def put(place: int, number: float) -> None:
    """A number to where the call that sets a variable takes it; anything but floating point is rounded."""
    kind, address, sign, is_boolean = _integers(place, 4)
    stored = STORAGE[kind]
    value = float((number >= 0.5) == (sign > 0)) if is_boolean else float(number) * sign
    _C_TYPES[stored].from_address(address).value = value if stored[0] == "f" else int(np.rint(value))


def exchange_values(instance: int, version: int, ports: Addresses) -> int:
    """Make the get or set calls of a table; the first status above warning ends it."""
    worst = 0
    for g in range(ports[1]):
        address, references, count, values, size = _integers(ports[0] + g * CALL_BYTES, 5)
        if version == 3:
            five = _function(address, c_void_p, c_size_t, c_void_p, c_size_t)
            status = five(instance, references, count, values, size)
        else:
            status = _function(address, c_void_p, c_size_t, c_void_p)(instance, references, count, values)
        worst = max(worst, status)
        if status > 1:
            break
    return worst


def read_row(instance: int, version: int, ports: Addresses, rows: int, width: int, column: int) -> int:
    """Read all variables of a table into one column of float64 rows of this width at this address."""
    status = exchange_values(instance, version, ports)
    if status <= 1:
        for j in range(ports[3]):
            target = c_double.from_address(rows + 8 * (j * width + column))
            target.value = fetch(ports[2] + j * PLACE_BYTES)
    return status


def write_row(instance: int, version: int, ports: Addresses, numbers: int) -> int:
    """Set all variables of a table to the float64 numbers at this address."""
    for j, number in enumerate(_floats(numbers, ports[3])):
        put(ports[2] + j * PLACE_BYTES, number)
    return exchange_values(instance, version, ports)


def enter_step_mode(functions: Functions) -> tuple[int, int]:
    """Leave the event mode that an FMI 3 FMU is in after its initialisation: status and where it stopped."""
    status, where = _settle_3(functions)
    if where == DONE:
        status = _function(functions[ENTER_STEP_MODE])(functions[INSTANCE])
        where = EVENT if status > 1 else DONE
    return status, where


def co_simulate(
    functions: Functions, ports: Addresses, pieces: Pieces, held_ports: Addresses, held_pieces: Pieces,
    current: int, values: int, getters: Addresses, outputs: int, width: int,
    stop_time: float, steps: int, first: int, last: int, every: int,
) -> tuple[int, int, int]:  # fmt: skip
    """Do the communication steps first..last-1; see stepping.co_simulate."""
    del current
    instance, version = functions[INSTANCE], functions[FMI_VERSION]
    kept = (c_double * held_ports[3]).from_address(values + 8 * ports[3])
    status, where, k, step = 0, DONE, first, stop_time / steps
    while k < last and where == DONE:
        start, end = k * step, stop_time if k + 1 == steps else min((k + 1) * step, stop_time)
        _put_inputs(ports, pieces, start)
        status = exchange_values(instance, version, ports)
        if status > 1:
            where = SETTING
            break
        new = _put_inputs(held_ports, held_pieces, start)
        if k > 0 and new != list(kept):
            status, where = _event_3(functions, held_ports)
            if where != DONE:
                break
        for j, value in enumerate(new):
            kept[j] = value
        status, where, ends = _advance(functions, start, end, end - start)
        if where != DONE:
            break
        k += 1
        if k % every == 0:
            status = read_row(instance, version, getters, outputs, width, k // every)
            where = GETTING if status > 1 else DONE
        if ends and where == DONE:
            where = TERMINATED
    return status, where, k


def _put_inputs(ports: Addresses, pieces: Pieces, time: float) -> list[float]:
    """Put all inputs of a table at a time into its buffers; returns their values."""
    address, count = pieces
    found = []
    for j in range(ports[3]):
        rows = np.array(_floats(address + j * count * PIECE_BYTES, 5 * count)).reshape(count, 5)
        start, c0, c1, c2, c3 = rows[rows[:, 0] <= time + 1e-11 * max(1.0, abs(time))][-1].tolist()
        dt = time - start
        found.append(((c3 * dt + c2) * dt + c1) * dt + c0)
        put(ports[2] + j * PLACE_BYTES, found[-1])
    return found


def _advance(functions: Functions, start: float, end: float, step: float) -> tuple[int, int, bool]:
    """One communication step: status, where it stopped, and whether the FMU asked to end the simulation."""
    if functions[FMI_VERSION] == 3:
        return _advance_3(functions, start, end)
    last_type = c_int if functions[FMI_VERSION] == 2 else c_uint8
    status = _function(functions[DO_STEP], c_double, c_double, last_type)(functions[INSTANCE], start, step, 1)
    return status, STEPPING if status > 1 else DONE, False


def _advance_3(functions: Functions, start: float, end: float) -> tuple[int, int, bool]:
    do_step = _function(functions[DO_STEP], c_double, c_double, c_uint8, *(c_void_p,) * 4)
    flags, reached = (c_uint8 * 3)(), c_double()
    a = ctypes.addressof(flags)
    time, rounds = start, 0
    while True:
        flags[:] = [0, 0, 0]
        status = do_step(functions[INSTANCE], time, end - time, 1, a, a + 1, a + 2, ctypes.addressof(reached))
        if status > 1:
            return status, STEPPING, False
        event, ends, early = map(bool, flags)
        before, time = time, (reached.value if early else end)
        if event and functions[EVENT_MODE] and not ends:
            status, where = _event_3(functions, (0, 0, 0, 0))
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


def _event_3(functions: Functions, ports: Addresses) -> tuple[int, int]:
    instance = functions[INSTANCE]
    status = _function(functions[ENTER_EVENT_MODE])(instance)
    if status > 1:
        return status, EVENT
    status = exchange_values(instance, 3, ports)
    if status > 1:
        return status, SETTING
    status, where = _settle_3(functions)
    if where != DONE:
        return status, where
    status = _function(functions[ENTER_STEP_MODE])(instance)
    return status, EVENT if status > 1 else DONE


def _settle_3(functions: Functions) -> tuple[int, int]:
    update = _function(functions[UPDATE_DISCRETE_STATES], *(c_void_p,) * 6)
    flags, next_time = (c_uint8 * 5)(), c_double()
    a = ctypes.addressof(flags)
    for _ in range(_MOST_ROUNDS):
        flags[0] = 0
        status = update(functions[INSTANCE], a, a + 1, a + 2, a + 3, a + 4, ctypes.addressof(next_time))
        if status > 1:
            return status, EVENT
        if flags[1]:
            return status, TERMINATED
        if not flags[0]:
            return status, DONE
    return 0, STUCK
