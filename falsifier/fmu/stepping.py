"""Compiled loops over an FMU's C functions.

numba compiles the loops; small intrinsics emit calls of C functions whose addresses are integers. The machine
code is therefore the same for every FMU and can be kept on disk; workers enter it through ``entries``.

Functions, tables and memory are passed as integer addresses, not as arrays: compiled code counts references
to every array that it touches, which would cost more than the rest of the loop. Every loop returns after a
bounded number of steps, so that its caller can check the time limit.
"""

from functools import partial
from typing import Any

import numpy as np

from falsifier.fmu.c_functions import (
    call_mode,
    do_step_1,
    do_step_2,
    do_step_3,
    load_f4,
    load_f8,
    load_i1,
    load_i2,
    load_i4,
    load_i8,
    load_u1,
    load_u2,
    load_u4,
    load_u8,
    next_number,
    stack_memory,
    store_f4,
    store_f8,
    store_i1,
    store_i2,
    store_i4,
    store_i8,
    store_u1,
    store_u2,
    store_u4,
    store_u8,
    update_3,
    values_2,
    values_3,
)
from falsifier.fmu.loop_numbers import (
    CALL_BYTES,
    DO_STEP,
    DONE,
    ENTER_EVENT_MODE,
    ENTER_STEP_MODE,
    EVENT,
    EVENT_MODE,
    FMI_VERSION,
    GETTING,
    INSTANCE,
    MOST_ROUNDS,
    PIECE_BYTES,
    PLACE_BYTES,
    SETTING,
    STATUS,
    STEP,
    STEPPING,
    STUCK,
    TERMINATED,
    UPDATE_DISCRETE_STATES,
    WHERE,
)
from falsifier.stl.numba_compilation import compiled as keep_compiled

compiled: Any = keep_compiled
# For functions called in every step: without inlining, each address would be passed as a separate argument.
inlined: Any = partial(keep_compiled, forceinline=True)


@inlined
def fetch(place):  # type: ignore[no-untyped-def]
    """Return a variable's value as a number, read from its location in a row of Ports.places."""
    kind, address, sign = load_i8(place), load_i8(place + 8), load_i8(place + 16)
    if kind == 0:
        return load_f8(address) * sign
    if kind == 1:
        value = np.float64(load_f4(address))
    elif kind == 2:
        value = np.float64(load_i1(address))
    elif kind == 3:
        value = np.float64(load_u1(address))
    elif kind == 4:
        value = np.float64(load_i2(address))
    elif kind == 5:
        value = np.float64(load_u2(address))
    elif kind == 6:
        value = np.float64(load_i4(address))
    elif kind == 7:
        value = np.float64(load_u4(address))
    elif kind == 8:
        value = np.float64(load_i8(address))
    else:
        value = np.float64(load_u8(address))
    if load_i8(place + 24):
        # Any non-zero value is true; the negated alias of a Boolean is its complement.
        return 1.0 if (value != 0.0) == (sign > 0) else 0.0
    return value * sign


@inlined
def put(place, number):  # type: ignore[no-untyped-def]
    """Write a number to a variable's location in a row of Ports.places; integers and Booleans are rounded."""
    kind, address, sign = load_i8(place), load_i8(place + 8), load_i8(place + 16)
    value = number * sign
    if kind == 0:
        store_f8(address, value)
        return
    if load_i8(place + 24):
        value = 1.0 if (number >= 0.5) == (sign > 0) else 0.0
    if kind == 1:
        store_f4(address, np.float32(value))
    elif kind == 2:
        store_i1(address, np.int8(np.rint(value)))
    elif kind == 3:
        store_u1(address, np.uint8(np.rint(value)))
    elif kind == 4:
        store_i2(address, np.int16(np.rint(value)))
    elif kind == 5:
        store_u2(address, np.uint16(np.rint(value)))
    elif kind == 6:
        store_i4(address, np.int32(np.rint(value)))
    elif kind == 7:
        store_u4(address, np.uint32(np.rint(value)))
    elif kind == 8:
        store_i8(address, np.int64(np.rint(value)))
    else:
        store_u8(address, np.uint64(np.rint(value)))


@inlined
def exchange_values(instance, version, ports):  # type: ignore[no-untyped-def]
    """Make the get or set calls of a table (Ports.table); stop at the first status worse than a warning."""
    worst = 0
    for g in range(ports[1]):
        call = ports[0] + g * CALL_BYTES
        function, references, count = load_i8(call), load_i8(call + 8), load_i8(call + 16)
        values = load_i8(call + 24)
        if version == 3:
            status = values_3(function, instance, references, count, values, load_i8(call + 32))
        else:
            status = values_2(function, instance, references, count, values)
        worst = max(worst, status)
        if status > 1:
            return worst
    return worst


@inlined
def read_row(instance, version, ports, rows, width, column):  # type: ignore[no-untyped-def]
    """Read all variables of a table into one column of the float64 rows of this width at this address."""
    status = exchange_values(instance, version, ports)
    if status <= 1:
        for j in range(ports[3]):
            store_f8(rows + 8 * (j * width + column), fetch(ports[2] + j * PLACE_BYTES))
    return status


@compiled
def write_row(instance, version, ports, numbers):  # type: ignore[no-untyped-def]
    """Set all variables of a table to the float64 numbers at this address."""
    for j in range(ports[3]):
        put(ports[2] + j * PLACE_BYTES, load_f8(numbers + 8 * j))
    return exchange_values(instance, version, ports)


@compiled
def four_numbers(a):  # type: ignore[no-untyped-def]
    """Return four integers from an address on, such as a table of ports."""
    return load_i8(a), load_i8(a + 8), load_i8(a + 16), load_i8(a + 24)


@inlined
def rounding(time):  # type: ignore[no-untyped-def]
    """Return the difference in s below which two times are considered equal."""
    return 1e-11 * max(1.0, abs(time))


@inlined
def spacing(number):  # type: ignore[no-untyped-def]
    """Return the distance from a number that is not negative to the next larger one, as numpy's function."""
    return next_number(number) - number


@inlined
def start_of(pieces, j, p):  # type: ignore[no-untyped-def]
    """Return the start in s of piece p of input j; inf after the last one."""
    return load_f8(pieces[0] + PIECE_BYTES * (j * pieces[1] + p)) if p < pieces[1] else np.inf


@inlined
def value_at(pieces, j, p, time):  # type: ignore[no-untyped-def]
    """Return input j at a time within its piece p or at its end; ``pieces``: address and number per input."""
    at = pieces[0] + PIECE_BYTES * (j * pieces[1] + p)
    dt = time - load_f8(at)
    return ((load_f8(at + 32) * dt + load_f8(at + 24)) * dt + load_f8(at + 16)) * dt + load_f8(at + 8)


@inlined
def _put_inputs(ports, pieces, current, values, time):  # type: ignore[no-untyped-def]
    """Write the values of all inputs of a table at a time to its buffers; return whether any has changed.

    ``current`` is the address of the inputs' current pieces, ``values`` that of the values written last.
    """
    changed = False
    for j in range(ports[3]):
        p = load_i8(current + 8 * j)
        while start_of(pieces, j, p + 1) <= time + rounding(time):
            p += 1
        store_i8(current + 8 * j, p)
        value = value_at(pieces, j, p, time)
        changed = changed or value != load_f8(values + 8 * j)
        store_f8(values + 8 * j, value)
        put(ports[2] + j * PLACE_BYTES, value)
    return changed


@compiled
def settle_3(functions, scratch):  # type: ignore[no-untyped-def]
    """Iterate events in FMI 3's event mode: update discrete states until nothing changes any more.

    Returns the status and where it stopped.
    """
    for _ in range(MOST_ROUNDS):
        # Outputs: again, terminate, nominals changed, states changed, next event defined; next event time.
        status = update_3(
            functions[UPDATE_DISCRETE_STATES], functions[INSTANCE],
            scratch, scratch + 1, scratch + 2, scratch + 3, scratch + 4, scratch + 8,
        )  # fmt: skip
        if status > 1:
            return status, EVENT
        if load_u1(scratch + 1):
            return status, TERMINATED
        if not load_u1(scratch):
            return status, DONE
    return 0, STUCK


@compiled
def event_3(functions, ports, scratch):  # type: ignore[no-untyped-def]
    """Enter event mode, set the inputs of a table, update the discrete states, return to step mode."""
    instance = functions[INSTANCE]
    status = call_mode(functions[ENTER_EVENT_MODE], instance)
    if status > 1:
        return status, EVENT
    status = exchange_values(instance, 3, ports)
    if status > 1:
        return status, SETTING
    status, where = settle_3(functions, scratch)
    if where != DONE:
        return status, where
    status = call_mode(functions[ENTER_STEP_MODE], instance)
    return status, EVENT if status > 1 else DONE


@inlined
def advance_3(functions, start, end, scratch):  # type: ignore[no-untyped-def]
    """Do one communication step of FMI 3, in several calls if the FMU returns early.

    Returns status, where it stopped, and whether the FMU requested to terminate the simulation.
    """
    time, rounds = start, 0
    while True:
        store_f8(scratch + 8, end)
        status = do_step_3(
            functions[DO_STEP], functions[INSTANCE], time, end - time, np.uint8(1),
            scratch, scratch + 1, scratch + 2, scratch + 8,
        )  # fmt: skip
        if status > 1:
            return status, STEPPING, False
        event, ends, early = load_u1(scratch) != 0, load_u1(scratch + 1) != 0, load_u1(scratch + 2) != 0
        before, time = time, (load_f8(scratch + 8) if early else end)
        if event and functions[EVENT_MODE] and not ends:
            status, where = event_3(functions, (0, 0, 0, 0), scratch)
            if where == TERMINATED:
                return status, DONE if time >= end else TERMINATED, True
            if where != DONE:
                return status, where, ends
        # A remainder smaller than this is a rounding error; FMUs reject steps that short.
        if ends or end - time <= 1e-12 * max(1.0, abs(end)):
            return status, DONE if end - time <= 1e-9 * max(1.0, abs(end)) else TERMINATED, ends
        rounds = 0 if time > before else rounds + 1
        if rounds > MOST_ROUNDS:
            return 0, STUCK, ends


@compiled
def co_simulate(  # type: ignore[no-untyped-def]
    functions, ports, pieces, held_ports, held_pieces, current, values, getters, outputs, width,
    stop_time, steps, first, last, every, report,
):  # fmt: skip
    """Do the communication steps first..last-1.

    The step sizes are differences of the communication points. The FMU adds them to its time again, which is
    exact for these; with k * step + step, it would pass the stop time by a rounding error, and some refuse.

    Args:
        functions: instance, function addresses, FMI version and whether event mode is used; see INSTANCE.
        ports: inputs that are set before each step (Ports.table).
        pieces: address of these inputs as piecewise cubics (Signal.pieces) and number of pieces per input;
            unused pieces start at inf.
        held_ports: inputs that may only be set in event mode (FMI 3 with event mode).
        held_pieces: the same for these inputs.
        current: address of the current piece of each input, then of each held input; int64, initially 0.
        values: address of the value last written to each of them.
        getters: recorded variables (Ports.table).
        outputs: address of one row of float64 per recorded variable; the caller writes column 0.
        width: length of such a row.
        stop_time: stop time in s.
        steps: number of steps to the stop time.
        first: first step to do.
        last: step before which to stop.
        every: steps per column of the outputs.
        report: receives FMI status, where it stopped, and number of completed steps, int64[3].
    """
    instance, version = functions[INSTANCE], functions[FMI_VERSION]
    scratch = stack_memory()
    status, where, k, step = 0, DONE, first, stop_time / steps
    while k < last and where == DONE:
        start = k * step
        end = stop_time if k + 1 == steps else min((k + 1) * step, stop_time)
        status, where = _set_inputs(
            functions, ports, pieces, held_ports, held_pieces, current, values, start, k > 0, scratch
        )
        if where != DONE:
            break
        ends = False
        if version == 3:
            status, where, ends = advance_3(functions, start, end, scratch)
        elif version == 2:
            status = do_step_2(functions[DO_STEP], instance, start, end - start, np.int32(1))
        else:
            status = do_step_1(functions[DO_STEP], instance, start, end - start, np.uint8(1))
        if status > 1 and where == DONE:
            where = STEPPING
        if where != DONE:
            break
        k += 1
        if k % every == 0:
            status = read_row(instance, version, getters, outputs, width, k // every)
            if status > 1:
                where = GETTING
        if ends and where == DONE:
            where = TERMINATED
    report[STATUS], report[WHERE], report[STEP] = status, where, k


@inlined
def _set_inputs(  # type: ignore[no-untyped-def]
    functions, ports, pieces, held_ports, held_pieces, current, values, time, is_initialised, scratch
):  # fmt: skip
    """Set the inputs at a communication point; return status and where it stopped."""
    if ports[3]:
        _put_inputs(ports, pieces, current, values, time)
        status = exchange_values(functions[INSTANCE], functions[FMI_VERSION], ports)
        if status > 1:
            return status, SETTING
    if held_ports[3]:
        offset = 8 * ports[3]
        changed = _put_inputs(held_ports, held_pieces, current + offset, values + offset, time)
        # Initialisation has already set their values at time 0.
        if changed and is_initialised:
            return event_3(functions, held_ports, scratch)
    return 0, DONE


@compiled
def enter_step_mode(functions):  # type: ignore[no-untyped-def]
    """Leave the event mode in which FMI 3 initialisation ends; return status and where it stopped."""
    status, where = settle_3(functions, stack_memory())
    if where == DONE:
        status = call_mode(functions[ENTER_STEP_MODE], functions[INSTANCE])
        where = EVENT if status > 1 else DONE
    return status, where
