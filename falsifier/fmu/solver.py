"""Model exchange: the solver.

Inputs are applied at every stage of every step. Steps end at output points, control points of the inputs and
time events. State events are located on the dense output, and the step is repeated up to the event; the state
at the event is then the result of a step and not interpolated. If stability rather than accuracy limits
explicit steps, the rest of the simulation uses implicit ones.
"""

import numpy as np

from falsifier.fmu.continuous import (
    INSTANCE,
    VERSION,
    complete_step,
    copy,
    derive,
    enter_pieces,
    get_indicators,
    handle_event,
    next_break,
)
from falsifier.fmu.integrators import explicit_step, implicit_step, interpolate
from falsifier.fmu.loop_numbers import DONE, EVENT, GETTING, PAUSED, STEPPING, STUCK, TERMINATED, TOO_SMALL
from falsifier.fmu.solver_memory import (
    COLUMN,
    EVENTS,
    IMPLICIT,
    JACOBIAN_KNOWN,
    NEXT_EVENT,
    NEXT_STEP,
    OTHER_HITS,
    STIFF_HITS,
    TIME,
)
from falsifier.fmu.stepping import compiled, read_row, rounding, spacing

# Constants of Hairer and Wanner: a problem is stiff after 15 steps with h times the dominant eigenvalue above
# 3.25 (the method is stable up to 3.3); 6 other steps in a row reset the count.
_STIFF_BOUND, _STIFF_STEPS, _OTHER_STEPS = 3.25, 15, 6
_SAFETY, _MIN_FACTOR, _MAX_FACTOR = 0.9, 0.2, 5.0
# Events within one output interval after which the FMU is considered stuck (Zeno behaviour).
_MAX_EVENTS = 10_000


@compiled
def advance(m, s, outputs, steps):  # type: ignore[no-untyped-def]
    """Continue a simulation for at most ``steps`` solver steps.

    Args:
        m: model, see ``continuous.Model``.
        s: memory of the simulation, see ``continuous.Memory``.
        outputs: receives the recorded variables, shape (k, samples); the caller writes column 0.
        steps: number of solver steps after which to return, so that the caller can check the time limit.

    Returns:
        FMI status and why it stopped: DONE at the stop time, PAUSED after ``steps``.
    """
    samples = outputs.shape[1]
    for _ in range(steps):
        if s.counts[COLUMN] >= samples:
            return 0, DONE
        grid_time = m.stop_time * s.counts[COLUMN] / (samples - 1)
        status, where = proceed(m, s, grid_time)
        time = s.clock[TIME]
        if where != DONE:
            # A model that terminates at the stop time has finished: only the last sample is left to record.
            last = s.counts[COLUMN] == samples - 1 and m.stop_time - time <= rounding(time)
            if where != TERMINATED or not last:
                return status, where
            s.clock[NEXT_EVENT] = np.inf
        if grid_time <= time + rounding(time):
            f = m.functions
            status = read_row(
                f[INSTANCE], f[VERSION], m.getters, outputs.ctypes.data, samples, s.counts[COLUMN]
            )
            if status > 1:
                return status, GETTING
            s.counts[COLUMN] += 1
            s.counts[EVENTS] = 0
    return 0, PAUSED if s.counts[COLUMN] < samples else DONE


@compiled
def proceed(m, s, limit):  # type: ignore[no-untyped-def]
    """Do one solver step towards a time limit in s, and the events at its end; return status and where."""
    target = min(limit, min(next_break(m, s), s.clock[NEXT_EVENT]))
    target = max(target, s.clock[TIME])
    wants_event = False
    if target - s.clock[TIME] > rounding(target):
        status, where, wants_event = _step_towards(m, s, target)
        if where != DONE:
            return status, where
    else:
        s.clock[TIME] = target
    time = s.clock[TIME]
    jumps = enter_pieces(m, s)
    if wants_event or jumps or s.clock[NEXT_EVENT] <= time + rounding(time):
        return pass_event(m, s)
    return 0, DONE


@compiled
def pass_event(m, s):  # type: ignore[no-untyped-def]
    """Handle an event, unless there were too many since the last output; return status and where."""
    s.counts[EVENTS] += 1
    if s.counts[EVENTS] > _MAX_EVENTS:
        return 0, STUCK
    return handle_event(m, s)


@compiled
def _step_towards(m, s, target):  # type: ignore[no-untyped-def]
    """Do one accepted step that ends at the target, at an event or in between.

    Returns status, where it stopped, and whether an event is pending at the new time.
    """
    h = _step_size(s, target)
    status, where, h = _accepted_step(m, s, h, target)
    if where != DONE:
        return status, where, False
    status = get_indicators(m, s.new_z)
    if status > 1:
        return status, EVENT, False
    wants_event = _sign_changes(s)
    if wants_event:
        status, where, h = _stop_at_event(m, s, h)
        if where != DONE:
            return status, where, False
    end = s.clock[TIME] + h
    s.clock[TIME] = target if target - end <= rounding(target) else end
    copy(s.x, s.new_x)
    copy(s.stages[0], s.stages[5 if s.counts[IMPLICIT] else 6])
    copy(s.z, s.new_z)
    if s.counts[STIFF_HITS] >= _STIFF_STEPS and not s.counts[IMPLICIT]:
        s.counts[IMPLICIT], s.counts[JACOBIAN_KNOWN] = 1, 0
    status, asks, ends = complete_step(m, s)
    if status > 1:
        return status, STEPPING, False
    return status, TERMINATED if ends else DONE, wants_event or asks


@compiled
def _step_size(s, target):  # type: ignore[no-untyped-def]
    """Return the proposed step, adjusted so that no tiny step remains before the target."""
    left = target - s.clock[TIME]
    h = s.clock[NEXT_STEP]
    if h >= left * (1.0 - 1e-6):
        return left
    return min(h, 0.5 * left) if 2.0 * h > left else h


@compiled
def _try_step(m, s, h):  # type: ignore[no-untyped-def]
    if s.counts[IMPLICIT]:
        status, error, stiffness = implicit_step(m, s, h)
        if status <= 1 and np.isfinite(error):
            # The FMU was last evaluated at an iterate of Newton's method; set it to the end of the step.
            status = derive(m, s, s.clock[TIME] + h, s.new_x, s.work[1])
        return status, error, stiffness
    return explicit_step(m, s, h)


@compiled
def _accepted_step(m, s, h, target):  # type: ignore[no-untyped-def]
    """Shorten the step until its error is within the tolerance; return status, where it stopped, the step."""
    tried = h
    while True:
        status, error, stiffness = _try_step(m, s, h)
        if status > 2:
            return status, STEPPING, h
        order = 4.0 if s.counts[IMPLICIT] else 5.0
        if status == 2 or not np.isfinite(error):
            factor = _MIN_FACTOR
        else:
            factor = _SAFETY * max(error, 1e-10) ** (-1.0 / order)
            factor = min(_MAX_FACTOR, max(_MIN_FACTOR, factor))
        accepted = status <= 1 and error <= 1.0
        if accepted:
            # A step that was cut short by a target is no reason to propose less than before.
            proposal = h * factor if h < tried else max(h * factor, s.clock[NEXT_STEP])
            s.clock[NEXT_STEP] = min(proposal, m.max_step)
        else:
            h = s.clock[NEXT_STEP] = h * min(factor, 0.9)
        if not s.counts[IMPLICIT] and np.isfinite(error):
            _watch_stiffness(s, stiffness)
        if accepted:
            return status, DONE, h
        # Give up once the step is too small to change the time in floating point.
        if h < 4.0 * spacing(max(abs(s.clock[TIME]), 1e-3 * m.stop_time)):
            return 0, TOO_SMALL, h


@compiled
def _watch_stiffness(s, stiffness):  # type: ignore[no-untyped-def]
    """Count steps at the limit of stability; after enough of them _step_towards changes to implicit steps."""
    if stiffness > _STIFF_BOUND:
        s.counts[OTHER_HITS] = 0
        s.counts[STIFF_HITS] += 1
    elif s.counts[STIFF_HITS]:
        s.counts[OTHER_HITS] += 1
        if s.counts[OTHER_HITS] >= _OTHER_STEPS:
            s.counts[STIFF_HITS] = 0


@compiled
def _sign_changes(s):  # type: ignore[no-untyped-def]
    changes = False
    for i in range(s.z.shape[0]):
        changes = changes or (s.z[i] > 0.0) != (s.new_z[i] > 0.0)
    return changes


@compiled
def _stop_at_event(m, s, h):  # type: ignore[no-untyped-def]
    """Repeat the last step up to the first sign change of an event indicator within it.

    Returns status, where it stopped, and the step.
    """
    status, theta = _locate(m, s, h)
    if status > 1:
        return status, EVENT, h
    nudge = max(1e-12, rounding(s.clock[TIME]) / h)
    while True:
        shorter = h * min(theta, 1.0)
        status, error, _ = _try_step(m, s, shorter)
        if status <= 1 and np.isfinite(error):
            status = get_indicators(m, s.new_z)
        if status > 1 or not np.isfinite(error):
            return max(status, 2), STEPPING, h
        # On the interpolant the sign may change slightly earlier than in the repeated step.
        if _sign_changes(s) or theta >= 1.0:
            return 0, DONE, shorter
        theta += nudge
        nudge *= 4.0


@compiled
def _locate(m, s, h):  # type: ignore[no-untyped-def]
    """Locate the first sign change within the last trial step; return status and theta just after it.

    Alternates two trials on either side of the secant's root with a bisection, which guarantees convergence.
    """
    low, high = 0.0, 1.0
    end_stage = 5 if s.counts[IMPLICIT] else 6
    z_low, z_high, z = s.trials[0], s.trials[1], s.trials[2]
    copy(z_low, s.z)
    copy(z_high, s.new_z)
    copy(z, s.new_z)
    state = s.work[0]
    width = max(1e-13, 0.1 * rounding(s.clock[TIME]) / h)
    trial = 0
    while high - low > width:
        gap = high - low
        root = 0.5
        if trial % 3 != 2:
            root = 1.0
            for i in range(z.shape[0]):
                if (z_low[i] > 0.0) != (z_high[i] > 0.0) and z_low[i] != z_high[i]:
                    root = min(root, z_low[i] / (z_low[i] - z_high[i]))
            root += 1e-3 if trial % 3 == 0 else -1e-3
        theta = low + gap * min(max(root, 1e-4), 1.0 - 1e-4)
        interpolate(s, h, theta, end_stage, state)
        status = derive(m, s, s.clock[TIME] + theta * h, state, s.work[1])
        if status <= 1:
            status = get_indicators(m, z)
        if status > 1:
            return status, high
        changed = False
        for i in range(z.shape[0]):
            changed = changed or (s.z[i] > 0.0) != (z[i] > 0.0)
        if changed:
            high = theta
            copy(z_high, z)
        else:
            low = theta
            copy(z_low, z)
        trial += 1
    return 0, high
