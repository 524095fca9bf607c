"""Candidates from elsewhere, made to fit a search space."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import floor

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.literals import shortest
from falsifier.core.ranges import InputRange, Range, is_outside, nearest_value, outside_text
from falsifier.core.signals import Interpolation, Signal, even_times
from falsifier.core.space import SearchSpace
from falsifier.errors import CandidateError


@dataclass(frozen=True, slots=True)
class Fitted:
    """A candidate of a search space, made from one that may not have fitted."""

    candidate: Candidate  # the candidate as it will be simulated
    notes: tuple[str, ...]  # what was changed, in words; empty if nothing was


def fit(space: SearchSpace, candidate: Candidate) -> Fitted:
    """Fit a candidate to a search space.

    Signals whose control points the space does not allow are sampled at as many evenly spaced ones as it
    allows. Inputs that are not searched are left out, and parameters that are not given are nominal.

    Raises:
        CandidateError: naming the searched input that is missing, the value outside its range, or the
            parameter without a value.
    """
    notes = [
        f"{name} is not searched: its values are not used"
        for name in (*candidate.signals, *candidate.parameters)
        if name not in space.names
    ]
    signals = {}
    for r in space.inputs:
        if r.name not in candidate.signals:
            raise _missing(r)
        given = candidate.signals[r.name]
        signals[r.name], changed = _fitted_signal(space, r, given)
        notes += [*changed, *_rounded(r, signals[r.name].values)]
        if given.hold != r.hold and len(given.times) > 1:
            notes.append(f"{r.name} is {'not held' if r.hold is None else f'held for {shortest(r.hold)} s'}")
    parameters = {}
    for p in space.parameters:
        value = candidate.parameters.get(p.name, p.nominal)
        is_given = p.name in candidate.parameters
        if value is None or (not is_given and is_outside(p, value)):
            raise _missing(p)
        if not is_given:
            notes.append(f"{p.name} is not given: its nominal value, {shortest(value)}, is used")
        notes += _rounded(p, (value,))
        parameters[p.name] = value
    return Fitted(
        space.admit(replace(candidate, signals=signals, parameters=parameters)), tuple(dict.fromkeys(notes))
    )


def _fitted_signal(space: SearchSpace, r: InputRange, signal: Signal) -> tuple[Signal, list[str]]:
    alone = SearchSpace((r,), (), space.stop_time)
    try:
        alone.admit(Candidate({r.name: signal}))
        return signal, []
    except CandidateError as error:
        reason = str(error)
    for time, value in zip(signal.times, signal.values, strict=True):
        if time <= space.stop_time and is_outside(r, value):
            raise CandidateError(f"{r.label} at t = {time:g} s: {value:.12g} is {outside_text(r)}")
    times, interpolation = _allowed(r, signal, space)
    values = signal.held(None).sample(np.asarray(times))
    sampled = Signal(times, tuple(float(v) for v in values), interpolation, r.hold)
    note = f"{r.name} is sampled at {len(times)} control points with {interpolation} interpolation ({reason})"
    return sampled, [note]


def _rounded(ranged: Range, values: Sequence[float]) -> list[str]:
    """Say that values are none that an input or parameter can have, if any is not."""
    is_rounded = any(nearest_value(ranged, value) != value for value in values)
    why = f"{ranged.name} can have certain numbers only: its values are rounded to the nearest ones"
    return [why] if is_rounded else []


def _allowed(r: InputRange, signal: Signal, space: SearchSpace) -> tuple[tuple[float, ...], Interpolation]:
    """Return the finest evenly spaced control points that the space allows for an input."""
    if r.free is None:
        return space.fixed_times(r), r.interpolation
    is_held = r.kind != "real" or signal.interpolation == "constant"
    interpolation: Interpolation = "constant" if is_held else "linear"
    pieces = max(1, floor(space.stop_time / r.free.min_interval * (1 + 1e-9)))
    count = min(r.free.max_control_points, pieces if is_held else pieces + 1)
    return even_times(count, stop_time=space.stop_time, interpolation=interpolation), interpolation


def _missing(ranged: Range) -> CandidateError:
    return CandidateError(f"{ranged.label} is searched and missing: give it, or keep it constant")
