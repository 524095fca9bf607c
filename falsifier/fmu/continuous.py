"""A model-exchange FMU as a differential equation: inputs, derivatives, event indicators, event iteration."""

import numpy as np
from numba.extending import intrinsic

from falsifier.fmu.c_functions import call_mode, call_signature, update_3
from falsifier.fmu.loop_numbers import (
    DONE,
    EVENT,
    MOST_ROUNDS,
    PLACE_BYTES,
    SETTING,
    STEPPING,
    STUCK,
    TERMINATED,
)
from falsifier.fmu.solver_memory import JACOBIAN_KNOWN, NEXT_EVENT, TIME
from falsifier.fmu.stepping import compiled, exchange_values, put, rounding, start_of, value_at

# Rows of the table of function addresses.
INSTANCE, VERSION, SET_TIME, SET_STATES, GET_STATES, GET_DERIVATIVES, GET_INDICATORS = range(7)
COMPLETED_STEP, ENTER_EVENT_MODE, UPDATE, ENTER_CONTINUOUS = range(7, 11)


@intrinsic
def _set_time(_typing, f, instance, time):  # type: ignore[no-untyped-def]
    return call_signature("pd")


@intrinsic
def _vector(_typing, f, instance, values, count):  # type: ignore[no-untyped-def]
    return call_signature("ppn")


@intrinsic
def _completed_1(_typing, f, instance, event):  # type: ignore[no-untyped-def]
    return call_signature("pp")


@intrinsic
def _completed_2(_typing, f, instance, no_return, event, end):  # type: ignore[no-untyped-def]
    return call_signature("pipp")


@intrinsic
def _completed_3(_typing, f, instance, no_return, event, end):  # type: ignore[no-untyped-def]
    return call_signature("pbpp")


@intrinsic
def _update_1(_typing, f, instance, intermediate, info):  # type: ignore[no-untyped-def]
    return call_signature("pbp")


@intrinsic
def _update_2(_typing, f, instance, info):  # type: ignore[no-untyped-def]
    return call_signature("pp")


@compiled
def copy(target, source):  # type: ignore[no-untyped-def]
    """Copy a vector in a loop; for a slice assignment numba would compile the formatting of its error too."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@compiled
def derive(m, s, time, x, derivatives):  # type: ignore[no-untyped-def]
    """Get the derivatives at a time within the inputs' current pieces; return the FMI status."""
    f, n = m.functions, x.shape[0]
    status = _set_time(f[SET_TIME], f[INSTANCE], time)
    if status <= 1 and n:
        status = _vector(f[SET_STATES], f[INSTANCE], x.ctypes.data, n)
    if status <= 1 and m.ports[3]:
        for j in range(m.ports[3]):
            put(m.ports[2] + j * PLACE_BYTES, value_at(m.pieces, j, s.piece[j], time))
        status = exchange_values(f[INSTANCE], f[VERSION], m.ports)
    if status <= 1 and n:
        status = _vector(f[GET_DERIVATIVES], f[INSTANCE], derivatives.ctypes.data, n)
        for i in range(n):
            if not np.isfinite(derivatives[i]):
                # Treat a step into a region where the model is undefined like fmi2Discard: retry a shorter
                # one.
                return max(status, 2)
    return status


@compiled
def get_indicators(m, z):  # type: ignore[no-untyped-def]
    """Get the event indicators at the FMU's current time and state; return the FMI status."""
    if not z.shape[0]:
        return 0
    return _vector(m.functions[GET_INDICATORS], m.functions[INSTANCE], z.ctypes.data, z.shape[0])


@compiled
def complete_step(m, s):  # type: ignore[no-untyped-def]
    """Report an accepted step to the FMU; return status, whether it requests an event, whether it ends."""
    f = m.functions
    s.events[:8] = 0
    a = s.events.ctypes.data
    if f[VERSION] == 1:
        status = _completed_1(f[COMPLETED_STEP], f[INSTANCE], a)
    elif f[VERSION] == 2:
        status = _completed_2(f[COMPLETED_STEP], f[INSTANCE], np.int32(1), a, a + 4)
    else:
        status = _completed_3(f[COMPLETED_STEP], f[INSTANCE], np.uint8(1), a, a + 4)
    return status, s.events[0] != 0, s.events[4] != 0


@compiled
def _update(m, s):  # type: ignore[no-untyped-def]
    """Do one round of event iteration and store the next time event.

    The offsets below are those of the fields in fmiEventInfo (FMI 1) and fmi2EventInfo (FMI 2), which the FMU
    fills; FMI 3 has separate arguments.

    Returns:
        FMI status, whether another round is needed, whether to terminate, whether states changed.
    """
    f = m.functions
    s.events[:] = 0
    a = s.events.ctypes.data
    times = s.events.view(np.float64)
    if f[VERSION] == 1:
        status = _update_1(f[UPDATE], f[INSTANCE], np.uint8(0), a)
        again, end, changed, defined = s.events[0] == 0, s.events[3] != 0, s.events[2] != 0, s.events[4] != 0
        next_time = times[1]
    elif f[VERSION] == 2:
        status = _update_2(f[UPDATE], f[INSTANCE], a)
        again, end, changed, defined = (
            s.events[0] != 0,
            s.events[4] != 0,
            s.events[12] != 0,
            s.events[16] != 0,
        )
        next_time = times[3]
    else:
        status = update_3(f[UPDATE], f[INSTANCE], a, a + 1, a + 2, a + 3, a + 4, a + 24)
        again, end, changed, defined = s.events[0] != 0, s.events[1] != 0, s.events[3] != 0, s.events[4] != 0
        next_time = times[3]
    s.clock[NEXT_EVENT] = next_time if defined else np.inf
    return status, again, end, changed


@compiled
def settle(m, s):  # type: ignore[no-untyped-def]
    """Iterate events until nothing changes, enter continuous time; return status and where it stopped."""
    f = m.functions
    any_change = False
    for _ in range(MOST_ROUNDS):
        status, again, end, changed = _update(m, s)
        if status > 1:
            return status, EVENT
        if end:
            return status, TERMINATED
        any_change = any_change or changed
        if not again:
            break
    else:
        return 0, STUCK
    if f[VERSION] > 1:
        status = call_mode(f[ENTER_CONTINUOUS], f[INSTANCE])
        if status > 1:
            return status, EVENT
    if any_change and s.x.shape[0]:
        status = _vector(f[GET_STATES], f[INSTANCE], s.x.ctypes.data, s.x.shape[0])
        if status > 1:
            return status, EVENT
    return refresh(m, s)


@compiled
def refresh(m, s):  # type: ignore[no-untyped-def]
    """Get derivatives and indicators at the current time and state; return status and where it stopped."""
    status = derive(m, s, s.clock[TIME], s.x, s.stages[0])
    if status > 1:
        return status, STEPPING
    status = get_indicators(m, s.z)
    s.counts[JACOBIAN_KNOWN] = 0
    return status, EVENT if status > 1 else DONE


@compiled
def handle_event(m, s):  # type: ignore[no-untyped-def]
    """Handle an event at the current time and state; return status and where it stopped."""
    f = m.functions
    if f[VERSION] > 1:
        status = call_mode(f[ENTER_EVENT_MODE], f[INSTANCE])
        if status > 1:
            return status, EVENT
    status = set_event_inputs(m, s)
    if status > 1:
        return status, SETTING
    return settle(m, s)


@compiled
def set_event_inputs(m, s):  # type: ignore[no-untyped-def]
    """Set all inputs to their values at the current time; return the FMI status."""
    f, time = m.functions, s.clock[TIME]
    for j in range(m.ports[3]):
        put(m.ports[2] + j * PLACE_BYTES, value_at(m.pieces, j, s.piece[j], time))
    status = exchange_values(f[INSTANCE], f[VERSION], m.ports)
    for j in range(m.held_ports[3]):
        value = value_at(m.held_pieces, j, s.piece[m.ports[3] + j], time)
        put(m.held_ports[2] + j * PLACE_BYTES, value)
    return max(status, exchange_values(f[INSTANCE], f[VERSION], m.held_ports))


@compiled
def next_break(m, s):  # type: ignore[no-untyped-def]
    """Return the time in s at which the next piece of any input starts; inf if there is none."""
    nearest = np.inf
    for j in range(m.ports[3]):
        nearest = min(nearest, start_of(m.pieces, j, s.piece[j] + 1))
    for j in range(m.held_ports[3]):
        nearest = min(nearest, start_of(m.held_pieces, j, s.piece[m.ports[3] + j] + 1))
    return nearest


@compiled
def enter_pieces(m, s):  # type: ignore[no-untyped-def]
    """Switch to the pieces that have started by now; return whether an input jumps."""
    now = s.clock[TIME] + rounding(s.clock[TIME])
    jumps = False
    for j in range(m.ports[3]):
        while start_of(m.pieces, j, s.piece[j] + 1) <= now:
            start = start_of(m.pieces, j, s.piece[j] + 1)
            before, after = (
                value_at(m.pieces, j, s.piece[j], start),
                value_at(m.pieces, j, s.piece[j] + 1, start),
            )
            s.piece[j] += 1
            jumps = jumps or abs(after - before) > 1e-9 * max(abs(after), abs(before))
    for j in range(m.held_ports[3]):
        k = m.ports[3] + j
        while start_of(m.held_pieces, j, s.piece[k] + 1) <= now:
            s.piece[k] += 1
            jumps = True
    return jumps
