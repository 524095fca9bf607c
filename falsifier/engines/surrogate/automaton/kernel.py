"""Compiled roll-out of a hybrid automaton; importing it imports numba."""

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array
from falsifier.engines.numba_compilation import compiled

# Terms of a Taylor polynomial.
_TERMS = 6
# Events that one step may contain; after these, the last output that had one rests until the step's end.
_MOST_EVENTS = 40
# An event's time is found to this share of a step.
_EXACT = 1e-8
# Steps of the search for it.
_MOST_STEPS = 40


@compiled
def _value(path: Array, high: int, low: int, threshold: float, time: float) -> float:
    """Value of a guard on Taylor polynomials, shape (n, _TERMS), minus its threshold."""
    value = -threshold
    power = 1.0
    for k in range(_TERMS):
        value += power * (path[high, k] - (path[low, k] if low >= 0 else 0.0))
        power *= time
    return float(value)


@compiled
def _rate(path: Array, high: int, low: int, time: float) -> float:
    """Rate of change of a guard's value."""
    rate, power = 0.0, 1.0
    for k in range(1, _TERMS):
        rate += k * power * (path[high, k] - (path[low, k] if low >= 0 else 0.0))
        power *= time
    return float(rate)


@compiled
def _extend(
    path: Array, laws: Array, i: int, mode: int, output: float, velocity: float, inputs: Array, cell: int
) -> None:
    """Fill in the Taylor polynomial of output i, whose acceleration is linear."""
    driven = inputs.shape[1]
    force, damping, stiffness = laws[i, mode, 0], laws[i, mode, 1], laws[i, mode, 2]
    for j in range(driven):
        force += laws[i, mode, 3 + j] * inputs[cell, j]
        damping += laws[i, mode, 3 + driven + j] * inputs[cell, j]
    path[i, 0], path[i, 1] = output, velocity
    path[i, 2] = (force + damping * velocity + stiffness * output) / 2
    for k in range(3, _TERMS):
        path[i, k] = (damping * (k - 1) * path[i, k - 1] + stiffness * path[i, k - 2]) / (k * (k - 1))


@compiled
def _crossing(path: Array, high: int, low: int, threshold: float, direction: float, span: float) -> float:
    """Return when a guard passes its threshold within a span of time; the span itself if it does not."""
    end = direction * _value(path, high, low, threshold, span)
    if end <= 0.0:
        return span
    start = direction * _value(path, high, low, threshold, 0.0)
    if start > 0.0:
        rate = _rate(path, high, low, 0.0)
        # Beyond the threshold from the start: due if it moves on.
        return 0.0 if rate * direction > 0.0 else span
    early, late, time = 0.0, span, span * start / (start - end)
    for _ in range(_MOST_STEPS):
        value = direction * _value(path, high, low, threshold, time)
        if value > 0.0:
            late = time
        else:
            early = time
        if late - early <= _EXACT * span:
            break
        # Newton's step, aimed a little beyond the root so that both ends close in; else the middle.
        rate = direction * _rate(path, high, low, time)
        aim = time - value / rate if rate > 0.0 else early
        aim += 0.5 * _EXACT * span if value <= 0.0 else -0.5 * _EXACT * span
        time = aim if early < aim < late else 0.5 * (early + late)
    # Just before the threshold: what is thrown back has it ahead again.
    return early


@compiled
def roll_out(
    laws: Array,
    guards: NDArray[np.intp],
    values: Array,
    modes: NDArray[np.intp],
    outputs: Array,
    velocities: Array,
    inputs: Array,
    cell: float,
    steps: int,
    samples: Array,
    first: NDArray[np.intp],
) -> int:
    """Predict one trajectory, at the steps and at each event; return the number of samples.

    Args:
        laws: coefficients of the accelerations, shape (n, modes, 3 + 2 p), see ``modes.features``.
        guards: output, source, target, high and low of each guard, shape (guards, 5).
        values: threshold, direction, factor and offset of each guard, shape (guards, 4).
        modes: modes at the start, shape (n,); changed in place.
        outputs: outputs at the start, shape (n,); changed in place.
        velocities: velocities at the start, shape (n,); changed in place.
        inputs: scaled inputs and parameters, shape (cells, p).
        cell: length of a cell in s.
        steps: steps per cell.
        samples: outputs at the samples, shape (most, n), to be filled in; what does not fit is left out.
        first: index of the first sample of each cell, and of the last sample, shape (cells + 1,), to be
            filled in.
    """
    n = len(outputs)
    path = np.empty((n, _TERMS))
    count = 0
    for c in range(len(inputs)):
        first[c] = count
        for _ in range(steps):
            rest, which = cell / steps, -1
            for event in range(_MOST_EVENTS):
                if count < len(samples) - (len(inputs) - c) * steps - 1 or event == 0:
                    for i in range(n):
                        samples[count, i] = outputs[i]
                    count += 1
                for i in range(n):
                    _extend(path, laws, i, modes[i], outputs[i], velocities[i], inputs, c)
                if event == _MOST_EVENTS - 1:
                    path[guards[which, 0], 1:] = 0.0
                span, which = rest, -1
                for g in range(len(guards)):
                    if modes[guards[g, 0]] == guards[g, 1] and event < _MOST_EVENTS - 1:
                        time = _crossing(path, guards[g, 3], guards[g, 4], values[g, 0], values[g, 1], span)
                        if time < span:
                            span, which = time, g
                for i in range(n):
                    outputs[i] = _value(path, i, -1, 0.0, span)
                    velocities[i] = _rate(path, i, -1, span)
                if which < 0:
                    break
                i = guards[which, 0]
                modes[i] = guards[which, 2]
                velocities[i] = values[which, 2] * velocities[i] + values[which, 3]
                rest -= span
    first[len(inputs)] = count
    for i in range(n):
        samples[count, i] = outputs[i]
    return count + 1
