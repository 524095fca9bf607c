"""Calls of FMI functions in another process, for compiled code that has their addresses.

A component with a process of its own has a *box*: memory that both processes share at the same address. To
the loops of coupled_stepping.py, the box is the component's instance, and its functions are those made here.
Each writes what it was called with to the box, counts up the requests, and waits until the other process has
counted up the replies. Both wait awake for a short time and sleep then.

Numba's cache of the functions with addresses does not notice changes in c_functions.py: after these, delete
``__pycache__``.
"""

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

import numpy as np
from numba import cfunc, types
from numba.extending import intrinsic

from falsifier.fmu.c_functions import (
    call_mode,
    call_signature,
    do_step_2,
    do_step_3,
    load_f8,
    load_i8,
    load_u1,
    store_f8,
    store_i8,
    store_u1,
    update_3,
    values_2,
    values_3,
)
from falsifier.fmu.library import TYPES
from falsifier.fmu.ports import bytes_per_value
from falsifier.fmu.stepping import compiled

# Words of a box: requests and replies so far, what to do, which function, how many references and values,
# bytes per value, two times in s, the FMI status, and 16 bytes that FMI 3 writes to.
REQUESTS, REPLIES, WHAT, FUNCTION, COUNT, SIZE, ITEM, START, STEP, STATUS, RESULTS = range(11)
# Addresses of functions to wait with, and the result of waitpid; the process that replies, and whether it has
# ended; seconds and nanoseconds to sleep, of each process.
NANOSLEEP, YIELD, WAITPID, EXIT, PID, IS_GONE, NAP_FOR_REPLY, NAP_FOR_REQUEST = (*range(13, 20), 21)
# Addresses of the FMU's functions in its process, then references and values.
FUNCTIONS, DATA = 24, 128
# Pages that nobody writes to take no memory.
BOX_BYTES = 64 << 20
# What to do.
GET, SET, STEP_2, STEP_3, MODE, UPDATE, GET_STATE, SET_STATE, OTHER = range(9)

# How often to look for a reply before sleeping, and how often between two moments in which others may have
# the processor; some 0.1 ms if nobody else wants it.
_LOOKS, _LOOKS_PER_YIELD = 40_000, 200
# Lengths of a sleep in ns. They grow, so that an idle process uses less than 1 % of a processor; a reply is
# noticed late by some 3 % of the time that it took.
_FIRST_NAP, _LONGEST_NAP = 50_000, 2_000_000
_NO_HANG = 1  # WNOHANG
_ERROR, _FATAL = 3, 4


def _ordered(kind: str) -> Any:
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        from llvmlite import ir

        place = builder.inttoptr(values[0], ir.IntType(64).as_pointer())
        if kind == "load":
            return builder.load_atomic(place, "acquire", 8)
        builder.store_atomic(values[1], place, "release", 8)
        return _context.get_dummy_value()

    return emit


@intrinsic
def _load_acquire(_typing, address):  # type: ignore[no-untyped-def]
    return types.int64(types.intp), _ordered("load")


@intrinsic
def _store_release(_typing, address, value):  # type: ignore[no-untyped-def]
    return types.void(types.intp, types.int64), _ordered("store")


@intrinsic
def _nanosleep(_typing, f, request, left):  # type: ignore[no-untyped-def]
    return call_signature("pp")


@intrinsic
def _sched_yield(_typing, f):  # type: ignore[no-untyped-def]
    return call_signature("")


@intrinsic
def _waitpid(_typing, f, pid, status, options):  # type: ignore[no-untyped-def]
    return call_signature("ipi")


@intrinsic
def _state(_typing, f, instance, state):  # type: ignore[no-untyped-def]
    return call_signature("pp")


@compiled
def _await(box, counter, number):  # type: ignore[no-untyped-def]
    """Wait until a counter has reached a number; return False if the process that counts has ended."""
    for k in range(_LOOKS):
        if _load_acquire(box + 8 * counter) == number:
            return True
        if k % _LOOKS_PER_YIELD == 0:
            _sched_yield(load_i8(box + 8 * YIELD))
    nap = box + 8 * (NAP_FOR_REPLY if counter == REPLIES else NAP_FOR_REQUEST)
    length = _FIRST_NAP
    while _load_acquire(box + 8 * counter) != number:
        store_i8(nap + 8, length)
        _nanosleep(load_i8(box + 8 * NANOSLEEP), nap, 0)
        length = min(length + length // 32, _LONGEST_NAP)
        if counter == REPLIES:
            pid = np.int32(load_i8(box + 8 * PID))
            if _waitpid(load_i8(box + 8 * WAITPID), pid, box + 8 * EXIT, np.int32(_NO_HANG)) != 0:
                store_i8(box + 8 * IS_GONE, 1)
                return _load_acquire(box + 8 * counter) == number
    return True


@compiled
def _ask(box, what, function):  # type: ignore[no-untyped-def]
    """Make a request and wait for the reply; return the FMI status, fatal if the process has ended."""
    if load_i8(box + 8 * IS_GONE):
        return np.int32(_FATAL)
    store_i8(box + 8 * WHAT, what)
    store_i8(box + 8 * FUNCTION, function)
    number = load_i8(box + 8 * REQUESTS) + 1
    _store_release(box + 8 * REQUESTS, number)
    if not _await(box, REPLIES, number):
        return np.int32(_FATAL)
    return np.int32(load_i8(box + 8 * STATUS))


@compiled
def _copy(source, target, count):  # type: ignore[no-untyped-def]
    for k in range(count // 8):
        store_i8(target + 8 * k, load_i8(source + 8 * k))
    for k in range(count // 8 * 8, count):
        store_u1(target + k, load_u1(source + k))


@compiled
def _exchange(box, what, function, references, count, values, size, item):  # type: ignore[no-untyped-def]
    data = box + 8 * DATA
    at = data + (4 * count + 7) // 8 * 8
    if at + item * size > box + BOX_BYTES:
        return np.int32(_ERROR)
    store_i8(box + 8 * COUNT, count)
    store_i8(box + 8 * SIZE, size)
    store_i8(box + 8 * ITEM, item)
    _copy(references, data, 4 * count)
    _copy(values, at, item * size)
    status = _ask(box, what, function)
    if what == GET:
        _copy(at, values, item * size)
    return status


@compiled
def serve(box, instance, version):  # type: ignore[no-untyped-def]
    """Reply to requests until one asks for something OTHER, which Python does; ``instance``: of the FMU."""
    while True:
        number = load_i8(box + 8 * REPLIES) + 1
        _await(box, REQUESTS, number)
        what = load_i8(box + 8 * WHAT)
        if what == OTHER:
            return
        function = load_i8(box + 8 * (FUNCTIONS + load_i8(box + 8 * FUNCTION)))
        store_i8(box + 8 * STATUS, np.int64(_called(box, instance, version, what, function)))
        _store_release(box + 8 * REPLIES, number)


@compiled
def answered(box):  # type: ignore[no-untyped-def]
    """Count something OTHER as replied."""
    _store_release(box + 8 * REPLIES, load_i8(box + 8 * REPLIES) + 1)


@compiled
def ask_other(box):  # type: ignore[no-untyped-def]
    """Request something OTHER, without waiting for the reply."""
    store_i8(box + 8 * WHAT, OTHER)
    _store_release(box + 8 * REQUESTS, load_i8(box + 8 * REQUESTS) + 1)


@compiled
def _called(box, instance, version, what, function):  # type: ignore[no-untyped-def]
    """Call a function of the FMU with what is in the box; return its status."""
    count, size = load_i8(box + 8 * COUNT), load_i8(box + 8 * SIZE)
    data, results = box + 8 * DATA, box + 8 * RESULTS
    values = data + (4 * count + 7) // 8 * 8
    start, step = load_f8(box + 8 * START), load_f8(box + 8 * STEP)
    if what in (GET, SET):
        if version == 3:
            return values_3(function, instance, data, count, values, size)
        return values_2(function, instance, data, count, values)
    if what == STEP_2:
        return do_step_2(function, instance, start, step, np.int32(1))
    if what == STEP_3:
        return do_step_3(
            function, instance, start, step, np.uint8(1), results, results + 1, results + 2, results + 8
        )
    if what == MODE:
        return call_mode(function, instance)
    if what == UPDATE:
        return update_3(
            function, instance, results, results + 1, results + 2, results + 3, results + 4, results + 8
        )
    if what == GET_STATE:
        return _state(function, instance, results)
    return _state(function, instance, load_i8(results))


_P, _N, _D, _I, _B, _STATUS = types.intp, types.intp, types.float64, types.int32, types.uint8, types.int32


def names(version: int) -> tuple[str, ...]:
    """Return the names, without ``fmi2``, of the functions that compiled loops call; their order is fixed."""
    state = "FMUState" if version == 3 else "FMUstate"
    modes = ("DoStep", "EnterEventMode", "UpdateDiscreteStates", "EnterStepMode")
    values = (f"{verb}{code}" for verb in ("Get", "Set") for code in TYPES[version])
    return (*modes, *(f"{verb}{state}" for verb in ("Get", "Set", "Free")), *values)


def warm_up(version: int, codes: Iterable[str]) -> None:
    """Compile what components of an FMI version with variables of these types need, or load it."""
    box = np.zeros(DATA, dtype=np.int64)
    ask_other(box.ctypes.data)
    serve(box.ctypes.data, 0, version)
    answered(box.ctypes.data)
    used = {f"{verb}{code}" for verb in ("Get", "Set") for code in codes}
    for name in names(version):
        if name in used or name[3:] not in TYPES[version]:
            stand_in(name, version)


@cache
def stand_in(name: str, version: int) -> Any:
    """Return a function that has an FMI function called in the other process.

    Args:
        name: name of the function, without ``fmi2``.
        version: FMI version, 2 or 3.

    Returns:
        The function with its ``address``; its argument for the instance is the box.
    """
    signature, make = _kind(name, version)
    item = bytes_per_value(version, name[3:]) if name[3:] in TYPES[version] else 0
    function = make(names(version).index(name), item)
    try:
        return cfunc(signature, cache=True, nopython=True)(function)
    except RuntimeError:  # numba found no writable cache folder
        return cfunc(signature, nopython=True)(function)


def _kind(name: str, version: int) -> tuple[Any, Callable[[int, int], Any]]:
    if name in ("GetFMUstate", "GetFMUState"):
        return _STATUS(_P, _P), _getting_state
    if name in ("SetFMUstate", "SetFMUState"):
        return _STATUS(_P, _P), _setting_state
    if name.startswith("Get"):
        return (
            (_STATUS(_P, _P, _N, _P, _N), _getting_3)
            if version == 3
            else (_STATUS(_P, _P, _N, _P), _getting_2)
        )
    if name.startswith("Set"):
        return (
            (_STATUS(_P, _P, _N, _P, _N), _setting_3)
            if version == 3
            else (_STATUS(_P, _P, _N, _P), _setting_2)
        )
    if name == "DoStep":
        return (
            (_STATUS(_P, _D, _D, _B, _P, _P, _P, _P), _step_3)
            if version == 3
            else (_STATUS(_P, _D, _D, _I), _step_2)
        )
    if name == "UpdateDiscreteStates":
        return _STATUS(_P, _P, _P, _P, _P, _P, _P), _updating
    return _STATUS(_P), _changing_mode


def _getting_2(number: int, item: int) -> Any:
    def get(box, references, count, values):  # type: ignore[no-untyped-def]
        return _exchange(box, GET, number, references, count, values, count, item)

    return get


def _setting_2(number: int, item: int) -> Any:
    def put(box, references, count, values):  # type: ignore[no-untyped-def]
        return _exchange(box, SET, number, references, count, values, count, item)

    return put


def _getting_3(number: int, item: int) -> Any:
    def get(box, references, count, values, size):  # type: ignore[no-untyped-def]
        return _exchange(box, GET, number, references, count, values, size, item)

    return get


def _setting_3(number: int, item: int) -> Any:
    def put(box, references, count, values, size):  # type: ignore[no-untyped-def]
        return _exchange(box, SET, number, references, count, values, size, item)

    return put


def _step_2(number: int, _item: int) -> Any:
    def do_step(box, start, step, _no_return):  # type: ignore[no-untyped-def]
        store_f8(box + 8 * START, start)
        store_f8(box + 8 * STEP, step)
        return _ask(box, STEP_2, number)

    return do_step


def _step_3(number: int, _item: int) -> Any:
    def do_step(box, start, step, _no_return, event, end, early, reached):  # type: ignore[no-untyped-def]
        results = box + 8 * RESULTS
        store_f8(box + 8 * START, start)
        store_f8(box + 8 * STEP, step)
        store_f8(results + 8, load_f8(reached))
        status = _ask(box, STEP_3, number)
        store_u1(event, load_u1(results))
        store_u1(end, load_u1(results + 1))
        store_u1(early, load_u1(results + 2))
        store_f8(reached, load_f8(results + 8))
        return status

    return do_step


def _updating(number: int, _item: int) -> Any:
    def update(box, again, end, nominals, states, defined, time):  # type: ignore[no-untyped-def]
        results = box + 8 * RESULTS
        status = _ask(box, UPDATE, number)
        store_u1(again, load_u1(results))
        store_u1(end, load_u1(results + 1))
        store_u1(nominals, load_u1(results + 2))
        store_u1(states, load_u1(results + 3))
        store_u1(defined, load_u1(results + 4))
        store_f8(time, load_f8(results + 8))
        return status

    return update


def _changing_mode(number: int, _item: int) -> Any:
    def change_mode(box):  # type: ignore[no-untyped-def]
        return _ask(box, MODE, number)

    return change_mode


def _getting_state(number: int, _item: int) -> Any:
    def get_state(box, state):  # type: ignore[no-untyped-def]
        store_i8(box + 8 * RESULTS, load_i8(state))
        status = _ask(box, GET_STATE, number)
        store_i8(state, load_i8(box + 8 * RESULTS))
        return status

    return get_state


def _setting_state(number: int, _item: int) -> Any:
    def set_state(box, state):  # type: ignore[no-untyped-def]
        store_i8(box + 8 * RESULTS, state)
        return _ask(box, SET_STATE, number)

    return set_state
