"""Events between modes: when they occur (guards) and what they do to velocities (resets)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.surrogate.automaton.modes import Modes
from falsifier.engines.surrogate.automaton.recording import Motion, Recording

# Samples at most between the pieces before and after an event.
_NEAR = 4
# Events of one kind: at least so many, and this share of all of the output's; what is rarer is left out.
_FEWEST, _LEAST_SHARE = 2, 0.02
# Events that are looked at, and the number of them at which a difference must be known, if there are so many.
_MOST_EVENTS, _KNOWN = 200, 5
# Share of the events for which a guard must hold: some events coincide with others.
_MOST_OF_THEM = 0.8
# Spread of a guard's value at its events, as a share of its spread at all times.
_SHARPNESS = 0.01
# Samples of a recording by which the latter is judged.
_SPREAD_SAMPLES = 500


@dataclass(frozen=True, slots=True)
class Guard:
    """An event: ``outputs[high] - outputs[low]`` passes a threshold while an output is in a mode.

    Attributes:
        output: the output whose mode changes.
        source: its mode before.
        target: its mode after.
        high: index of an output.
        low: index of the output that is subtracted, or -1.
        threshold: value at which the event occurs.
        direction: 1 if the value rises through the threshold, -1 if it falls.
        factor: what the output's velocity is multiplied by.
        offset: what is added to it then.
    """

    output: int
    source: int
    target: int
    high: int
    low: int
    threshold: float
    direction: float
    factor: float
    offset: float


@dataclass(frozen=True, slots=True)
class _Event:
    """An event of one output: its time, the output's value, and its velocity before and after.

    Its time is known well only if the velocity jumps.
    """

    recording: int
    time: float
    source: int
    target: int
    value: float
    before: float
    after: float
    is_located: bool

    @property
    def kind(self) -> tuple[int, int, bool]:
        return self.source, self.target, self.after > self.before


def find_guards(
    recordings: Sequence[Recording], motions: Sequence[Motion], modes: Sequence[Modes]
) -> list[Guard] | None:
    """Return the guards of all outputs, or None if some events have no recognisable guard."""
    guards = []
    for motion, its in zip(motions, modes, strict=True):
        found = list(_events(recordings, motion, its))
        events = sorted((e for e in found if e.is_located), key=lambda e: e.kind)
        known = set()
        for _, group in groupby(events, key=lambda e: e.kind):
            alike = list(group)
            if len(alike) < max(_FEWEST, _LEAST_SHARE * len(events)):
                continue
            guard = _guard(recordings, motions, motion.output, alike)
            if guard is None:
                return None
            guards.append(guard)
            known.add((guard.source, guard.target))
        # What was seen only where velocities do not jump will also happen elsewhere.
        if any((e.source, e.target) not in known for e in found if not e.is_located):
            return None
    return guards


def _events(recordings: Sequence[Recording], motion: Motion, modes: Modes) -> Iterator[_Event]:
    """Yield the events between neighbouring pieces at which the mode changes or the velocity jumps."""
    for (before, source), (after, target) in pairwise(zip(motion.pieces, modes.labels, strict=True)):
        recording = recordings[before.recording]
        if before.recording != after.recording or min(source, target) < 0:
            continue
        if (
            after.start - before.stop > _NEAR
            or not recording.is_driven_smoothly[before.stop : after.start].all()
        ):
            continue
        middle = 0.5 * (before.stop + after.start + 1) * recording.step
        ahead = _parabola(recording, motion.output, before.last, middle)
        behind = _parabola(recording, motion.output, after.first, middle)
        least = motion.unit * recording.step
        time = _meeting(ahead - behind, least)
        is_near = time is not None and abs(time) <= _NEAR * recording.step
        time = time if time is not None and is_near else 0.0
        old, new = (float(2 * part[0] * time + part[1]) for part in (ahead, behind))
        is_located = is_near and abs(new - old) > least
        if is_located or source != target:
            yield _Event(
                before.recording,
                middle + time,
                int(source),
                int(target),
                float(ahead[2] + time * (ahead[1] + time * ahead[0])),
                old,
                new,
                is_located,
            )


def _meeting(difference: Array, least: float) -> float | None:
    """Return the root next to 0 of a parabola; None if the velocity changes less than ``least`` there."""
    if abs(difference[1]) <= least:
        return None
    time = 0.0
    for _ in range(4):
        slope = 2 * difference[0] * time + difference[1]
        if slope == 0.0:
            return None
        time -= float(difference[2] + time * (difference[1] + time * difference[0])) / slope
    return time


def _guard(
    recordings: Sequence[Recording], motions: Sequence[Motion], output: int, events: Sequence[_Event]
) -> Guard | None:
    """Return the output or difference of two that is nearly the same at all these events."""
    chosen = events[:: -(-len(events) // _MOST_EVENTS)]
    values = [[_at(recordings, motion, output, event) for motion in motions] for event in chosen]
    value, slope = np.moveaxis(np.array(values), 2, 0)
    best, sharpest = None, _SHARPNESS
    for high in range(len(motions)):
        for low in range(-1, high):
            at = value[:, high] - (value[:, low] if low >= 0 else 0.0)
            known = np.isfinite(at)
            if known.sum() < min(_KNOWN, len(chosen)):
                continue
            threshold = float(np.median(at[known]))
            rate = slope[known, high] - (slope[known, low] if low >= 0 else 0.0)
            direction = 1.0 if np.median(rate) > 0.0 else -1.0
            # What stands still is the same at all events, too.
            if np.mean(rate * direction > 0.0) < _MOST_OF_THEM:
                continue
            spread = float(np.quantile(np.abs(at[known] - threshold), _MOST_OF_THEM))
            sharpness = spread / _spread(recordings, high, low)
            if sharpness < sharpest:
                best, sharpest = (high, low, threshold, direction), sharpness
    if best is None:
        return None
    before, after = np.array([e.before for e in events]), np.array([e.after for e in events])
    factor, offset = _reset(before, after)
    return Guard(output, events[0].source, events[0].target, *best, factor, offset)


def _at(recordings: Sequence[Recording], motion: Motion, output: int, event: _Event) -> tuple[float, float]:
    """Return an output and its velocity just before an event of another; NaN next to an event of its own."""
    if motion.output == output:
        return event.value, event.before
    recording = recordings[event.recording]
    last = int(event.time / recording.step)
    smooth = motion.is_smooth[event.recording]
    if not 2 <= last < len(smooth) or not smooth[last - 2 : last + 1].all():
        return np.nan, np.nan
    parabola = _parabola(recording, motion.output, last - 1, event.time)
    return float(parabola[2]), float(parabola[1])


def _parabola(recording: Recording, output: int, row: int, time: float) -> Array:
    """Return the parabola through an output around a row's sample: coefficients of powers of t - time."""
    later = time - (row + 1) * recording.step
    half = 0.5 * recording.acceleration[row, output]
    velocity = recording.velocity[row, output]
    value = recording.outputs[row + 1, output] + later * (velocity + later * half)
    return np.array([half, velocity + 2 * half * later, value])


def _reset(before: Array, after: Array) -> tuple[float, float]:
    """Return factor and offset of ``after = factor * before + offset``; without a slope, the factor is 1."""
    if np.ptp(before) <= 1e-6 * np.abs(before).max(initial=0.0):
        return 1.0, float(np.median(after - before))
    factor, offset = np.polyfit(before, after, 1)
    error = np.abs(after - factor * before - offset)
    good = error <= 3 * np.median(error) + 1e-12
    factor, offset = np.polyfit(before[good], after[good], 1)
    return float(factor), float(offset)


def _spread(recordings: Sequence[Recording], high: int, low: int) -> float:
    """Return the interquartile range of an output or a difference of two at all times."""
    parts = [r.outputs[:: 1 + len(r.outputs) // _SPREAD_SAMPLES] for r in recordings]
    values = np.concatenate([part[:, high] - (part[:, low] if low >= 0 else 0.0) for part in parts])
    return float(np.subtract(*np.percentile(values, [75, 25]))) + 1e-9 * float(np.abs(values).max()) + 1e-300
