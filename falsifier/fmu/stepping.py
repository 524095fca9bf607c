"""Compiled loops over an FMU's C functions.

numba compiles the loops; small intrinsics emit calls of C functions whose addresses are plain integers, so
that the machine code is cached on disk and serves every FMU. Intrinsics and loops share this file because
numba's cache notices changes of the file of the cached function only.

Addresses of scratch memory and of functions travel in integer tables (see ports.Ports for the tables of
variables). Every loop returns after a bounded number of steps, so that its caller can look at the clock.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

# Why a loop stopped: `report[WHERE]`.
DONE, SETTING, STEPPING, GETTING, EVENT, TERMINATED, STUCK = range(7)
STATUS, WHERE, STEP = range(3)

# Rows of the table of function addresses of a co-simulation FMU.
INSTANCE, DO_STEP, ENTER_EVENT_MODE, UPDATE_DISCRETE_STATES, ENTER_STEP_MODE, FMI_VERSION, EVENT_MODE = range(
    7
)

# Columns of a piece of an input: start time in s, then coefficients of 1, dt, dt**2, dt**3 (Signal.pieces).
START, C0, C1, C2, C3 = range(5)

# Early returns at one time before the FMU counts as stuck, and rounds of one event iteration.
_MOST_ROUNDS = 1000

_BYTE = ir.IntType(8)
_POINTER = _BYTE.as_pointer()
_LLVM = {"p": _POINTER, "n": ir.IntType(64), "d": ir.DoubleType(), "i": ir.IntType(32), "b": _BYTE}
_NUMBA = {"p": types.intp, "n": types.intp, "d": types.float64, "i": types.int32, "b": types.uint8}


def call_signature(arguments: str) -> Any:
    """Signature and code of a call ``int f(...)``: p pointer, n size_t, d double, i int, b bool or char."""

    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        kind = ir.FunctionType(ir.IntType(32), [_LLVM[a] for a in arguments])
        function = builder.inttoptr(values[0], kind.as_pointer())
        passed = [
            builder.inttoptr(value, _POINTER) if a == "p" else value
            for a, value in zip(arguments, values[1:], strict=True)
        ]
        return builder.call(function, passed)

    return types.int32(types.intp, *(_NUMBA[a] for a in arguments)), emit


def _load(kind: Any, stored: ir.Type) -> Any:
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.load(builder.inttoptr(values[0], stored.as_pointer()))

    return kind(types.intp), emit


def _store(kind: Any, stored: ir.Type) -> Any:
    def emit(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        builder.store(values[1], builder.inttoptr(values[0], stored.as_pointer()))
        return context.get_dummy_value()

    return types.void(types.intp, kind), emit


@intrinsic
def _values_2(_typing, f, instance, references, count, values):  # type: ignore[no-untyped-def]
    return call_signature("ppnp")


@intrinsic
def _values_3(_typing, f, instance, references, count, values, size):  # type: ignore[no-untyped-def]
    return call_signature("ppnpn")


@intrinsic
def _do_step_1(_typing, f, instance, time, step, new_step):  # type: ignore[no-untyped-def]
    return call_signature("pddb")


@intrinsic
def _do_step_2(_typing, f, instance, time, step, no_return):  # type: ignore[no-untyped-def]
    return call_signature("pddi")


@intrinsic
def _do_step_3(_typing, f, instance, time, step, no_return, event, end, early, reached):  # type: ignore[no-untyped-def]
    return call_signature("pddbpppp")


@intrinsic
def call_mode(_typing, f, instance):  # type: ignore[no-untyped-def]
    """Call a function that takes the instance alone."""
    return call_signature("p")


@intrinsic
def _update_3(_typing, f, instance, again, end, nominals, states, defined, time):  # type: ignore[no-untyped-def]
    return call_signature("ppppppp")


def _typed(kind: Any, stored: ir.Type) -> tuple[Any, Any]:
    @intrinsic
    def load(_typing, address):  # type: ignore[no-untyped-def]
        return _load(kind, stored)

    @intrinsic
    def store(_typing, address, value):  # type: ignore[no-untyped-def]
        return _store(kind, stored)

    return load, store


_load_f8, _store_f8 = _typed(types.float64, ir.DoubleType())
_load_f4, _store_f4 = _typed(types.float32, ir.FloatType())
_load_i1, _store_i1 = _typed(types.int8, ir.IntType(8))
_load_u1, _store_u1 = _typed(types.uint8, ir.IntType(8))
_load_i2, _store_i2 = _typed(types.int16, ir.IntType(16))
_load_u2, _store_u2 = _typed(types.uint16, ir.IntType(16))
_load_i4, _store_i4 = _typed(types.int32, ir.IntType(32))
_load_u4, _store_u4 = _typed(types.uint32, ir.IntType(32))
_load_i8, _store_i8 = _typed(types.int64, ir.IntType(64))
_load_u8, _store_u8 = _typed(types.uint64, ir.IntType(64))

compiled = njit(cache=True, nogil=True, error_model="numpy")


@compiled
def fetch(places, j):  # type: ignore[no-untyped-def]
    """Variable j as a number, from where its call left it."""
    kind, address, sign = places[j, 0], places[j, 1], places[j, 2]
    if kind == 0:
        return _load_f8(address) * sign
    if kind == 1:
        value = np.float64(_load_f4(address))
    elif kind == 2:
        value = np.float64(_load_i1(address))
    elif kind == 3:
        value = np.float64(_load_u1(address))
    elif kind == 4:
        value = np.float64(_load_i2(address))
    elif kind == 5:
        value = np.float64(_load_u2(address))
    elif kind == 6:
        value = np.float64(_load_i4(address))
    elif kind == 7:
        value = np.float64(_load_u4(address))
    elif kind == 8:
        value = np.float64(_load_i8(address))
    else:
        value = np.float64(_load_u8(address))
    if places[j, 3]:
        # Any non-zero byte is true; a negated Boolean is its complement.
        return 1.0 if (value != 0.0) == (sign > 0) else 0.0
    return value * sign


@compiled
def put(places, j, number):  # type: ignore[no-untyped-def]
    """A number to where the call that sets variable j takes it; anything but floating point is rounded."""
    kind, address, sign = places[j, 0], places[j, 1], places[j, 2]
    value = number * sign
    if kind == 0:
        _store_f8(address, value)
        return
    if places[j, 3]:
        value = 1.0 if (number >= 0.5) == (sign > 0) else 0.0
    if kind == 1:
        _store_f4(address, np.float32(value))
    elif kind == 2:
        _store_i1(address, np.int8(np.rint(value)))
    elif kind == 3:
        _store_u1(address, np.uint8(np.rint(value)))
    elif kind == 4:
        _store_i2(address, np.int16(np.rint(value)))
    elif kind == 5:
        _store_u2(address, np.uint16(np.rint(value)))
    elif kind == 6:
        _store_i4(address, np.int32(np.rint(value)))
    elif kind == 7:
        _store_u4(address, np.uint32(np.rint(value)))
    elif kind == 8:
        _store_i8(address, np.int64(np.rint(value)))
    else:
        _store_u8(address, np.uint64(np.rint(value)))


@compiled
def exchange_values(instance, version, calls):  # type: ignore[no-untyped-def]
    """Call the get or set functions of a table; the first status above warning ends it."""
    worst = 0
    for g in range(calls.shape[0]):
        if version == 3:
            status = _values_3(calls[g, 0], instance, calls[g, 1], calls[g, 2], calls[g, 3], calls[g, 4])
        else:
            status = _values_2(calls[g, 0], instance, calls[g, 1], calls[g, 2], calls[g, 3])
        worst = max(worst, status)
        if status > 1:
            break
    return worst


@compiled
def read_row(instance, version, calls, places, rows, column):  # type: ignore[no-untyped-def]
    """Read all variables of a table into one column of ``rows``."""
    status = exchange_values(instance, version, calls)
    if status <= 1:
        for j in range(places.shape[0]):
            rows[j, column] = fetch(places, j)
    return status


@compiled
def write_row(instance, version, calls, places, rows, column):  # type: ignore[no-untyped-def]
    """Set all variables of a table to one column of ``rows``."""
    for j in range(places.shape[0]):
        put(places, j, rows[j, column])
    return exchange_values(instance, version, calls)


@compiled
def rounding(time):  # type: ignore[no-untyped-def]
    """Times closer than this are one time; s."""
    return 1e-11 * max(1.0, abs(time))


@compiled
def value_at(pieces, j, p, time):  # type: ignore[no-untyped-def]
    """Input j at a time within (or at the end of) its piece p."""
    dt = time - pieces[j, p, START]
    return ((pieces[j, p, C3] * dt + pieces[j, p, C2]) * dt + pieces[j, p, C1]) * dt + pieces[j, p, C0]


@compiled
def _put_inputs(places, pieces, current, first, time, values):  # type: ignore[no-untyped-def]
    """Put all inputs of a table at a time into its buffers; whether any differs from before.

    ``current[first:]`` are the pieces that the inputs are in, ``values[first:]`` what was put last.
    """
    changed = False
    for j in range(places.shape[0]):
        p = current[first + j]
        while p + 1 < pieces.shape[1] and pieces[j, p + 1, START] <= time + rounding(time):
            p += 1
        current[first + j] = p
        value = value_at(pieces, j, p, time)
        changed = changed or value != values[first + j]
        values[first + j] = value
        put(places, j, value)
    return changed


@compiled
def settle_3(functions, flags, reached):  # type: ignore[no-untyped-def]
    """Event iteration of FMI 3 in event mode: update discrete states until nothing changes any more.

    Returns the status and where it stopped.
    """
    for _ in range(_MOST_ROUNDS):
        flags[0] = 0
        # again, terminate, nominals changed, states changed, next event defined; next event time
        a = flags.ctypes.data
        status = _update_3(
            functions[UPDATE_DISCRETE_STATES],
            functions[INSTANCE],
            a,
            a + 1,
            a + 2,
            a + 3,
            a + 4,
            reached.ctypes.data + 8,
        )
        if status > 1:
            return status, EVENT
        if flags[1]:
            return status, TERMINATED
        if not flags[0]:
            return status, DONE
    return 0, STUCK


@compiled
def _event_3(functions, flags, reached, discrete_calls):  # type: ignore[no-untyped-def]
    """One visit to event mode: set the discrete inputs, update, return to step mode."""
    instance = functions[INSTANCE]
    status = call_mode(functions[ENTER_EVENT_MODE], instance)
    if status > 1:
        return status, EVENT
    status = exchange_values(instance, 3, discrete_calls)
    if status > 1:
        return status, SETTING
    status, where = settle_3(functions, flags, reached)
    if where != DONE:
        return status, where
    status = call_mode(functions[ENTER_STEP_MODE], instance)
    return status, EVENT if status > 1 else DONE


@compiled
def _advance_3(functions, start, end, flags, reached, no_calls):  # type: ignore[no-untyped-def]
    """One communication step of FMI 3, in several calls where the FMU returns early.

    Returns status, where it stopped and whether the FMU asked to end the simulation.
    """
    time, rounds = start, 0
    a, r = flags.ctypes.data, reached.ctypes.data
    ends = False
    while True:
        flags[0] = flags[1] = flags[2] = 0
        reached[0] = end
        status = _do_step_3(
            functions[DO_STEP],
            functions[INSTANCE],
            time,
            end - time,
            np.uint8(1),
            a,
            a + 1,
            a + 2,
            r,
        )
        if status > 1:
            return status, STEPPING, ends
        event, ends, early = flags[0] != 0, flags[1] != 0, flags[2] != 0
        before, time = time, (reached[0] if early else end)
        if event and functions[EVENT_MODE] and not ends:
            status, where = _event_3(functions, flags, reached, no_calls)
            if where == TERMINATED:
                return status, DONE if time >= end else TERMINATED, True
            if where != DONE:
                return status, where, ends
        # What is left of a step below this is rounding, and no FMU steps that far.
        if ends or end - time <= 1e-12 * max(1.0, abs(end)):
            return status, DONE if end - time <= 1e-9 * max(1.0, abs(end)) else TERMINATED, ends
        rounds = 0 if time > before else rounds + 1
        if rounds > _MOST_ROUNDS:
            return 0, STUCK, ends


@compiled
def co_simulate(  # type: ignore[no-untyped-def]
    functions, set_calls, set_places, event_calls, event_places, get_calls, get_places,
    pieces, event_pieces, current, values, outputs, step, first, last, every, report,
):  # fmt: skip
    """Do the communication steps first..last-1.

    Args:
        functions: addresses and facts, int64[7].
        set_calls: inputs that are set before each step, see ports.Ports.
        set_places: their places.
        event_calls: inputs that are set in event mode only (FMI 3 with event mode).
        event_places: their places.
        get_calls: recorded variables.
        get_places: their places.
        pieces: inputs as piecewise cubics, shape (n, pieces, 5); pieces that are not there start at inf.
        event_pieces: the same for the event-mode inputs, shape (m, pieces, 5).
        current: pieces that the inputs are in, int64[n + m]; zeros at the start.
        values: what the inputs were set to last, shape (n + m,).
        outputs: receives the recorded variables, shape (k, samples); column 0 is the caller's.
        step: communication step in s.
        first: first step to do.
        last: step to stop before.
        every: steps per column of the outputs.
        report: receives FMI status, reason and number of completed steps, int64[3].
    """
    instance, version = functions[INSTANCE], functions[FMI_VERSION]
    flags = np.zeros(8, dtype=np.uint8)
    reached = np.zeros(2)
    no_calls = event_calls[:0]
    n = set_places.shape[0]
    report[STATUS], report[WHERE], report[STEP] = 0, DONE, first
    for k in range(first, last):
        report[STEP] = k
        if n:
            _put_inputs(set_places, pieces, current, 0, k * step, values)
            report[STATUS] = exchange_values(instance, version, set_calls)
            if report[STATUS] > 1:
                report[WHERE] = SETTING
                return
        if event_calls.shape[0]:
            changed = _put_inputs(event_places, event_pieces, current, n, k * step, values)
            # Initialisation has set their first values.
            if changed and k > 0:
                report[STATUS], report[WHERE] = _event_3(functions, flags, reached, event_calls)
                if report[WHERE] != DONE:
                    return
        ends = False
        if version == 3:
            status, where, ends = _advance_3(functions, k * step, (k + 1) * step, flags, reached, no_calls)
            report[STATUS], report[WHERE] = status, where
            if where != DONE:
                return
        elif version == 2:
            report[STATUS] = _do_step_2(functions[DO_STEP], instance, k * step, step, np.int32(1))
        else:
            report[STATUS] = _do_step_1(functions[DO_STEP], instance, k * step, step, np.uint8(1))
        if report[STATUS] > 1:
            report[WHERE] = STEPPING
            return
        report[STEP] = k + 1
        if (k + 1) % every == 0:
            column = (k + 1) // every
            report[STATUS] = read_row(instance, version, get_calls, get_places, outputs, column)
            if report[STATUS] > 1:
                report[WHERE] = GETTING
                return
        if ends:
            report[WHERE] = TERMINATED
            return


@compiled
def enter_step_mode(functions):  # type: ignore[no-untyped-def]
    """Leave the event mode that an FMI 3 FMU is in after its initialisation: status and where it stopped."""
    flags = np.zeros(8, dtype=np.uint8)
    reached = np.zeros(2)
    status, where = settle_3(functions, flags, reached)
    if where == DONE:
        status = call_mode(functions[ENTER_STEP_MODE], functions[INSTANCE])
        where = EVENT if status > 1 else DONE
    return status, where
