"""Model exchange: the solver that the FMU does not bring.

Inputs are applied at every stage of every step. Steps end on output points, control points of the inputs and
time events. State events are located on the dense output, and the step is done again up to the event, so that
the state there is a full step's and not an interpolant's. Explicit steps change to implicit ones for the rest
of the run where stability rather than accuracy limits them.
"""

import numpy as np

from falsifier.fmu.continuous import (
    COLUMN,
    EVENTS,
    IMPLICIT,
    INSTANCE,
    JACOBIAN_KNOWN,
    NEXT_EVENT,
    NEXT_STEP,
    OTHER_HITS,
    STIFF_HITS,
    TIME,
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
from falsifier.fmu.stepping import (
    DONE,
    EVENT,
    GETTING,
    STEPPING,
    STUCK,
    TERMINATED,
    compiled,
    read_row,
    rounding,
)

# Constants of Hairer and Wanner: so many steps with h times rate above the bound (the method is stable up to
# 3.3) make a problem stiff, and so many others in between do not.
_STIFF_BOUND, _STIFF_STEPS, _OTHER_STEPS = 3.25, 15, 6
_SAFETY, _LEAST_FACTOR, _MOST_FACTOR = 0.9, 0.2, 5.0
# Events within one output interval before they count as piled up (Zeno).
_MOST_EVENTS = 10_000
PAUSED = 100


@compiled
def advance(m, s, outputs, steps):  # type: ignore[no-untyped-def]
    """Go on with a run for at most so many solver steps.

    Args:
        m: model, see continuous.Model.
        s: memory of the run.
        outputs: receives the recorded variables, shape (k, samples); column 0 is the caller's.
        steps: number of solver steps after which the caller wants to look at the clock.

    Returns:
        FMI status and why it stopped: DONE at the stop time, PAUSED after ``steps``.
    """
    samples = outputs.shape[1]
    for _ in range(steps):
        if s.counts[COLUMN] >= samples:
            return 0, DONE
        grid_time = m.stop_time * s.counts[COLUMN] / (samples - 1)
        target = min(grid_time, min(next_break(m, s), s.clock[NEXT_EVENT]))
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
            s.counts[EVENTS] += 1
            if s.counts[EVENTS] > _MOST_EVENTS:
                return 0, STUCK
            status, where = handle_event(m, s)
            if where != DONE:
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
def _step_towards(m, s, target):  # type: ignore[no-untyped-def]
    """One accepted step that ends at the target, at an event or in between.

    Returns status, where it stopped, and whether an event waits at the new time.
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
    """The proposed step, fitted to the target so that no sliver is left before it."""
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
            # The FMU was last asked at an iterate: bring it to the end of the step.
            status = derive(m, s, s.clock[TIME] + h, s.new_x, s.work[1])
        return status, error, stiffness
    return explicit_step(m, s, h)


@compiled
def _accepted_step(m, s, h, target):  # type: ignore[no-untyped-def]
    """Shorten the step until its error is below the tolerance: status, where it stopped, step."""
    tried = h
    while True:
        status, error, stiffness = _try_step(m, s, h)
        if status > 2:
            return status, STEPPING, h
        order = 4.0 if s.counts[IMPLICIT] else 5.0
        if status == 2 or not np.isfinite(error):
            factor = _LEAST_FACTOR
        else:
            factor = _SAFETY * max(error, 1e-10) ** (-1.0 / order)
            factor = min(_MOST_FACTOR, max(_LEAST_FACTOR, factor))
        accepted = status <= 1 and error <= 1.0
        if accepted:
            # A step that a target cut short says nothing against the longer one proposed before.
            proposal = h * factor if h < tried else max(h * factor, s.clock[NEXT_STEP])
            s.clock[NEXT_STEP] = min(proposal, m.max_step)
        else:
            h = s.clock[NEXT_STEP] = h * min(factor, 0.9)
        if not s.counts[IMPLICIT] and np.isfinite(error):
            _watch_stiffness(s, stiffness)
        if accepted:
            return status, DONE, h
        if h < 4.0 * np.spacing(max(abs(s.clock[TIME]), 1e-3 * m.stop_time)):
            return status, STEPPING, h


@compiled
def _watch_stiffness(s, stiffness):  # type: ignore[no-untyped-def]
    """Change to implicit steps after many steps in a row at the limit of stability."""
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
    """Do the last step again, up to the first sign change of an event indicator within it.

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
        # The interpolant may see the change a little before the step does.
        if _sign_changes(s) or theta >= 1.0:
            return 0, DONE, shorter
        theta += nudge
        nudge *= 4.0


@compiled
def _locate(m, s, h):  # type: ignore[no-untyped-def]
    """First sign change within the last tried step: status, and where just behind it in [0, 1].

    Two trials on either side of a secant's root, then a bisection, and again.
    """
    low, high = 0.0, 1.0
    end_stage = 5 if s.counts[IMPLICIT] else 6
    z_low, z_high, z = s.z.copy(), s.new_z.copy(), s.new_z.copy()
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
