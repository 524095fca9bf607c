"""Compiled loops over the C functions of several connected FMUs.

As in stepping.py, everything is passed as integer addresses, and a loop returns after a bounded number of
steps.

Three kinds of rows of eight-byte numbers describe a system. A *component* row has the component's functions
and ports; components are in the order in which they step. A *feed* row says where the value of one input
comes from. A *signal* row has the last two values of one connected output. A component of model exchange has
a solver row too, see coupled_solver.py.
"""

import numpy as np
from numba.extending import intrinsic

from falsifier.fmu.c_functions import (
    call_signature,
    do_step_1,
    do_step_2,
    load_f8,
    load_i8,
    store_f8,
    store_i8,
)
from falsifier.fmu.loop_numbers import (
    DONE,
    GETTING,
    PLACE_BYTES,
    SETTING,
    STATUS,
    STEP,
    STEPPING,
    TERMINATED,
    WHERE,
)
from falsifier.fmu.solver_row import SOLVER_ENDS, SOLVER_STATUS
from falsifier.fmu.stepping import (
    advance_3,
    compiled,
    event_3,
    exchange_values,
    fetch,
    inlined,
    put,
    rounding,
    start_of,
    value_at,
)

COMPONENT = 3  # in the report, after STATUS, WHERE and STEP
NOT_CONVERGED, RESTORING, NOT_A_NUMBER = 9, 10, 11  # where a loop stopped, beside those of loop_numbers.py

# Columns of a component: the functions as for co_simulate, then four tables of ports (Ports.table).
FUNCTIONS, PLAIN, HELD, SOURCES, RECORDED = 0, 7, 11, 15, 19
# Address of the feeds of plain and of held inputs; communication steps per step of its own; address of the
# first signal; address of the addresses of the rows to record to; whether a held input has changed. Of model
# exchange also the address of the function that integrates, and of the solver row; 0 for co-simulation.
PLAIN_FEEDS, HELD_FEEDS, EVERY, SIGNALS, ROWS, CHANGED = range(23, 29)
INTEGRATE, SOLVER = 29, 30
# Of the first component of a loop that is iterated, the position after its last one, otherwise 0; of all of
# them, functions that save and restore the state, address of the saved one, and of the feeds as they were.
LOOP_END, GET_STATE, SET_STATE, STATE, KEPT_FEEDS, COMPONENT_WIDTH = range(31, 37)
# Columns of a feed: address of pieces or of a signal, which of the two, current piece, value written last,
# factor, offset, value before the signal is known, whether it follows a line; and of model exchange the
# address of the piece that the input follows within a step.
SOURCE, IS_SIGNAL, PIECE, WRITTEN, FACTOR, OFFSET, START, LINEAR, LINE, FEED_WIDTH = range(10)
# Columns of a signal: value, time in s (negative: not known yet), the same before, value of the round before.
VALUE, TIME, OLD_VALUE, OLD_TIME, TRIED, SIGNAL_WIDTH = range(6)

_COMPONENT_BYTES, _FEED_BYTES, _SIGNAL_BYTES = 8 * COMPONENT_WIDTH, 8 * FEED_WIDTH, 8 * SIGNAL_WIDTH
# Columns of a copy: address of a signal, address of the row to record it to.
_COPY_BYTES = 16


# What to ask of the function that integrates: a step, a step that begins with an event, keep the present,
# bring back what was kept. Columns of a solver row for FMI status and whether the FMU ends the simulation.
SOLVE, EVENT_AND_SOLVE, KEEP, BRING_BACK = range(4)


@intrinsic
def _integrate(_typing, f, row, start, end, what):  # type: ignore[no-untyped-def]
    return call_signature("nddn")


@intrinsic
def _state(_typing, f, instance, state):  # type: ignore[no-untyped-def]
    return call_signature("pp")


@inlined
def _table(component, column):  # type: ignore[no-untyped-def]
    at = component + 8 * column
    return load_i8(at), load_i8(at + 8), load_i8(at + 16), load_i8(at + 24)


@inlined
def _functions(component):  # type: ignore[no-untyped-def]
    return (
        load_i8(component), load_i8(component + 8), load_i8(component + 16), load_i8(component + 24),
        load_i8(component + 32), load_i8(component + 40), load_i8(component + 48),
    )  # fmt: skip


@inlined
def _fed(feed, count, start, middle):  # type: ignore[no-untyped-def]
    """Return the value of an input for a step: a piece at its start, or a signal, in a line to its middle."""
    source = load_i8(feed + 8 * SOURCE)
    if not load_i8(feed + 8 * IS_SIGNAL):
        pieces, p = (source, count), load_i8(feed + 8 * PIECE)
        while start_of(pieces, 0, p + 1) <= start + rounding(start):
            p += 1
        store_i8(feed + 8 * PIECE, p)
        return load_f8(feed + 8 * FACTOR) * value_at(pieces, 0, p, start) + load_f8(feed + 8 * OFFSET)
    time = load_f8(source + 8 * TIME)
    if time < 0.0:
        return load_f8(feed + 8 * START)
    value = load_f8(source + 8 * VALUE) + _slope(feed, source) * (middle - time)
    return load_f8(feed + 8 * FACTOR) * value + load_f8(feed + 8 * OFFSET)


@inlined
def _slope(feed, source):  # type: ignore[no-untyped-def]
    """Return the slope of the line that an input follows, before its conversion; 0 if it is held."""
    time, before = load_f8(source + 8 * TIME), load_f8(source + 8 * OLD_TIME)
    if load_i8(feed + 8 * LINEAR) and 0.0 <= before < time:
        return (load_f8(source + 8 * VALUE) - load_f8(source + 8 * OLD_VALUE)) / (time - before)
    return 0.0


@inlined
def _write(ports, feeds, count, start, middle):  # type: ignore[no-untyped-def]
    """Write the values of all inputs of a table to its buffers; return whether any has changed."""
    changed = False
    for j in range(ports[3]):
        feed = feeds + j * _FEED_BYTES
        value = _fed(feed, count, start, middle)
        changed = changed or value != load_f8(feed + 8 * WRITTEN)
        store_f8(feed + 8 * WRITTEN, value)
        put(ports[2] + j * PLACE_BYTES, value)
    return changed


@inlined
def _gather(component, count, start, middle):  # type: ignore[no-untyped-def]
    """Collect a component's inputs for a step; the FMU gets them when the step begins."""
    _write(_table(component, PLAIN), load_i8(component + 8 * PLAIN_FEEDS), count, start, middle)
    held = _table(component, HELD)
    if held[3]:
        feeds = load_i8(component + 8 * HELD_FEEDS)
        changed = _write(held, feeds, count, start, middle)
        store_i8(component + 8 * CHANGED, 1 if changed else 0)


@inlined
def _draw(ports, feeds, count, start, least):  # type: ignore[no-untyped-def]
    """Write the lines that connected inputs follow from here; return whether any jumps, beyond rounding."""
    jumps = False
    for j in range(ports[3]):
        feed = feeds + j * _FEED_BYTES
        if load_i8(feed + 8 * IS_SIGNAL):
            line = load_i8(feed + 8 * LINE)
            value = _fed(feed, count, start, start)
            before = load_f8(line + 8) + load_f8(line + 16) * (start - load_f8(line))
            jumps = jumps or not abs(value - before) <= least * max(abs(value), abs(before))
            slope = load_f8(feed + 8 * FACTOR) * _slope(feed, load_i8(feed + 8 * SOURCE))
            store_f8(line, start)
            store_f8(line + 8, value)
            store_f8(line + 16, slope)
    return jumps


@inlined
def _prepare(component, count, start, middle):  # type: ignore[no-untyped-def]
    """Collect a component's inputs for a step: values, or the lines that model exchange follows."""
    if not load_i8(component + 8 * INTEGRATE):
        _gather(component, count, start, middle)
        return
    plain, held = load_i8(component + 8 * PLAIN_FEEDS), load_i8(component + 8 * HELD_FEEDS)
    jumps = _draw(_table(component, PLAIN), plain, count, start, 1e-9)
    jumps = _draw(_table(component, HELD), held, count, start, 0.0) or jumps
    store_i8(component + 8 * CHANGED, 1 if jumps else 0)


@inlined
def _solve(component, start, end):  # type: ignore[no-untyped-def]
    """Integrate a component of model exchange; like _step."""
    what = EVENT_AND_SOLVE if load_i8(component + 8 * CHANGED) else SOLVE
    row = load_i8(component + 8 * SOLVER)
    where = np.int64(_integrate(load_i8(component + 8 * INTEGRATE), row, start, end, what))
    return load_i8(row + 8 * SOLVER_STATUS), where, load_i8(row + 8 * SOLVER_ENDS) != 0


@inlined
def _step(component, start, end, scratch):  # type: ignore[no-untyped-def]
    """Give a component its inputs and do its step; return status, where it stopped, whether it ends all."""
    if load_i8(component + 8 * INTEGRATE):
        return _solve(component, start, end)
    instance, version = load_i8(component), load_i8(component + 40)
    status = exchange_values(instance, version, _table(component, PLAIN))
    if status > 1:
        return status, SETTING, False
    if load_i8(component + 8 * CHANGED):
        store_i8(component + 8 * CHANGED, 0)
        status, where = event_3(_functions(component), _table(component, HELD), scratch)
        if where != DONE:
            return status, where, False
    if version == 3:
        return advance_3(_functions(component), start, end, scratch)
    if version == 2:
        status = do_step_2(load_i8(component + 8), instance, start, end - start, np.int32(1))
    else:
        status = do_step_1(load_i8(component + 8), instance, start, end - start, np.uint8(1))
    return status, STEPPING if status > 1 else DONE, False


@inlined
def read_signals(component, time):  # type: ignore[no-untyped-def]
    """Read a component's connected outputs; return the status."""
    ports = _table(component, SOURCES)
    status = exchange_values(load_i8(component), load_i8(component + 40), ports)
    if status <= 1:
        for j in range(ports[3]):
            signal = load_i8(component + 8 * SIGNALS) + j * _SIGNAL_BYTES
            if load_f8(signal + 8 * TIME) != time:
                store_f8(signal + 8 * OLD_VALUE, load_f8(signal + 8 * VALUE))
                store_f8(signal + 8 * OLD_TIME, load_f8(signal + 8 * TIME))
            store_f8(signal + 8 * TRIED, load_f8(signal + 8 * VALUE))
            store_f8(signal + 8 * VALUE, fetch(ports[2] + j * PLACE_BYTES))
            store_f8(signal + 8 * TIME, time)
    return status


@inlined
def _read(component, time):  # type: ignore[no-untyped-def]
    """Read a component's connected outputs; return status, and where to stop if one of them is NaN."""
    status = read_signals(component, time)
    if status > 1:
        return status, GETTING
    for j in range(load_i8(component + 8 * (SOURCES + 3))):
        value = load_f8(load_i8(component + 8 * SIGNALS) + j * _SIGNAL_BYTES + 8 * VALUE)
        # Otherwise the component that receives it would fail, and be blamed.
        if value != value:
            return status, NOT_A_NUMBER
    return status, DONE


@inlined
def _copy(source, target, numbers):  # type: ignore[no-untyped-def]
    for i in range(numbers):
        store_i8(target + 8 * i, load_i8(source + 8 * i))


@inlined
def _keep(component):  # type: ignore[no-untyped-def]
    """Keep a component's state before a step that may be repeated; return the FMI status."""
    feeds = FEED_WIDTH * (load_i8(component + 8 * (PLAIN + 3)) + load_i8(component + 8 * (HELD + 3)))
    _copy(load_i8(component + 8 * PLAIN_FEEDS), load_i8(component + 8 * KEPT_FEEDS), feeds)
    if load_i8(component + 8 * INTEGRATE):
        _integrate(load_i8(component + 8 * INTEGRATE), load_i8(component + 8 * SOLVER), 0.0, 0.0, KEEP)
    return _state(load_i8(component + 8 * GET_STATE), load_i8(component), load_i8(component + 8 * STATE))


@inlined
def _bring_back(component):  # type: ignore[no-untyped-def]
    """Bring a component back to where its step began; return the FMI status."""
    feeds = FEED_WIDTH * (load_i8(component + 8 * (PLAIN + 3)) + load_i8(component + 8 * (HELD + 3)))
    _copy(load_i8(component + 8 * KEPT_FEEDS), load_i8(component + 8 * PLAIN_FEEDS), feeds)
    if load_i8(component + 8 * INTEGRATE):
        _integrate(load_i8(component + 8 * INTEGRATE), load_i8(component + 8 * SOLVER), 0.0, 0.0, BRING_BACK)
    state = load_i8(load_i8(component + 8 * STATE))
    return _state(load_i8(component + 8 * SET_STATE), load_i8(component), state)


@inlined
def _moves(component, tolerance):  # type: ignore[no-untyped-def]
    """Whether any connected output has changed since the round before."""
    moves = False
    for j in range(load_i8(component + 8 * (SOURCES + 3))):
        signal = load_i8(component + 8 * SIGNALS) + j * _SIGNAL_BYTES
        value = load_f8(signal + 8 * VALUE)
        change = abs(value - load_f8(signal + 8 * TRIED))
        moves = moves or not change <= tolerance * max(1.0, abs(value))
    return moves


@compiled
def _iterate(  # type: ignore[no-untyped-def]
    components, first, last, k, step, end, count, tolerance, rounds, running, scratch, report
):
    """Repeat a step of the components of a loop until their outputs agree.

    Returns where it stopped, and whether a component ends the simulation; writes status and component to the
    report.
    """
    report[COMPONENT] = first
    ends = False
    for r in range(rounds):
        moves, ends = False, False
        for c in range(first, last):
            component = components + c * _COMPONENT_BYTES
            own = load_i8(component + 8 * EVERY)
            if own != 1 and (k + 1) % own:
                continue
            store_f8(running, float(c))
            status = _keep(component) if r == 0 else _bring_back(component)
            where = RESTORING if status > 1 else DONE
            if where == DONE:
                start = (k + 1 - own) * step
                _prepare(component, count, start, 0.5 * (start + end))
                status, where, ended = _step(component, start, end, scratch)
                ends = ends or ended
            if where == DONE:
                status, where = _read(component, end)
            if where != DONE:
                report[STATUS], report[COMPONENT] = status, c
                return where, ends
            moves = moves or _moves(component, tolerance)
        if r > 0 and not moves:
            return DONE, ends
    return NOT_CONVERGED, ends


@compiled
def record(components, number, copies, copied, column, report):  # type: ignore[no-untyped-def]
    """Record a sample: connected outputs as they were exchanged, other variables as the FMUs say."""
    for j in range(copied):
        copy = copies + j * _COPY_BYTES
        store_f8(load_i8(copy + 8) + 8 * column, load_f8(load_i8(copy) + 8 * VALUE))
    for c in range(number):
        component = components + c * _COMPONENT_BYTES
        ports = _table(component, RECORDED)
        if ports[3]:
            status = exchange_values(load_i8(component), load_i8(component + 40), ports)
            if status > 1:
                report[STATUS], report[WHERE], report[COMPONENT] = status, GETTING, c
                return False
            rows = load_i8(component + 8 * ROWS)
            for j in range(ports[3]):
                store_f8(load_i8(rows + 8 * j) + 8 * column, fetch(ports[2] + j * PLACE_BYTES))
    return True


@compiled
def start_round(components, number, count, tolerance, running, report):  # type: ignore[no-untyped-def]
    """In initialisation: give each component its inputs at time 0 and read its outputs, in their order.

    Returns whether any connected output has changed since the round before. The report gets the first
    component with an output that is NaN, -1 if there is none.
    """
    moves, missing = False, -1
    for c in range(number):
        store_f8(running, float(c))
        component = components + c * _COMPONENT_BYTES
        instance, version = load_i8(component), load_i8(component + 40)
        _gather(component, count, 0.0, 0.0)
        status = exchange_values(instance, version, _table(component, PLAIN))
        if status <= 1:
            status = exchange_values(instance, version, _table(component, HELD))
        if status > 1:
            report[STATUS], report[WHERE], report[COMPONENT] = status, SETTING, c
            return True
        store_i8(component + 8 * CHANGED, 0)
        status, where = _read(component, 0.0)
        if where == GETTING:
            report[STATUS], report[WHERE], report[COMPONENT] = status, GETTING, c
            return True
        moves = moves or _moves(component, tolerance)
        if where == NOT_A_NUMBER and missing < 0:
            missing = c
    report[WHERE], report[COMPONENT] = DONE, missing
    return moves


@compiled
def co_simulate_system(  # type: ignore[no-untyped-def]
    components, number, jacobi, tolerance, rounds, count, copies, copied, stop_time, steps, first, last,
    every, running, report,
):  # fmt: skip
    """Do the communication steps first..last-1 of all components.

    A component whose own step is several communication steps does it at the end of these, so that nobody gets
    a value from the future. With Jacobi, it uses the inputs of its start.

    Args:
        components: address of the component rows, in the order in which they step.
        number: number of components.
        jacobi: whether all step from the values of the same communication point.
        tolerance: change, relative above 1, below which an iterated step has converged.
        rounds: maximum number of rounds of such a step.
        count: number of pieces per input that is not connected.
        copies: addresses of the signals to record, and of the rows to record them to.
        copied: number of these.
        stop_time: stop time in s.
        steps: number of communication steps to the stop time.
        first: first step to do.
        last: step before which to stop.
        every: steps per column of the outputs; the caller records column 0.
        running: address at which to say which component's code runs (float64).
        report: receives FMI status, where it stopped, number of completed steps, component, int64[4].
    """
    memory = np.zeros(16, dtype=np.uint8)
    scratch = memory.ctypes.data
    where, k, step = DONE, first, stop_time / steps
    report[STATUS], report[COMPONENT] = 0, 0
    while k < last and where == DONE:
        end = stop_time if k + 1 == steps else min((k + 1) * step, stop_time)
        if jacobi:
            for c in range(number):
                component = components + c * _COMPONENT_BYTES
                own = load_i8(component + 8 * EVERY)
                if k % own == 0:
                    start = k * step
                    _prepare(component, count, start, start + 0.5 * own * step)
        ends, c = False, 0
        while c < number:
            component = components + c * _COMPONENT_BYTES
            loop_end = load_i8(component + 8 * LOOP_END)
            if loop_end:
                where, ended = _iterate(
                    components, c, loop_end, k, step, end, count, tolerance, rounds, running, scratch, report
                )
                if where != DONE:
                    break
                ends = ends or ended
                c = loop_end
                continue
            own = load_i8(component + 8 * EVERY)
            if own != 1 and (k + 1) % own:
                c += 1
                continue
            start = (k + 1 - own) * step
            if not jacobi:
                _prepare(component, count, start, 0.5 * (start + end))
            store_f8(running, float(c))
            status, where, ended = _step(component, start, end, scratch)
            if ended:
                ends = True
                report[COMPONENT] = c
            if where == DONE and not jacobi:
                status, where = _read(component, end)
            if where != DONE:
                report[STATUS], report[COMPONENT] = status, c
                break
            c += 1
        if jacobi and where == DONE:
            for c in range(number):
                component = components + c * _COMPONENT_BYTES
                if (k + 1) % load_i8(component + 8 * EVERY) == 0:
                    status, where = _read(component, end)
                    if where != DONE:
                        report[STATUS], report[COMPONENT] = status, c
                        break
        if where != DONE:
            break
        k += 1
        if k % every == 0 and not record(components, number, copies, copied, k // every, report):
            where = GETTING
        if ends and where == DONE:
            where = TERMINATED
    report[WHERE], report[STEP] = where, k
    # A use after the last call: otherwise numba may free the memory while an FMU writes to its address.
    memory[0] = 0
