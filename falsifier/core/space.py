"""Search spaces: what may be varied, by name, with ranges and parameterizations.

If every parameterization is fixed, the search space is also a named box; ``decode`` and ``encode`` convert
between vectors and candidates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, prod

import numpy as np
from numpy.typing import NDArray

from falsifier.core.arguments import positive
from falsifier.core.candidate import Candidate
from falsifier.core.ranges import (
    Freedom,
    InputRange,
    ParameterRange,
    Range,
    Scale,
    into_range,
    is_outside,
    outside_text,
)
from falsifier.core.signals import Signal, even_times
from falsifier.errors import CandidateError, SpecError, did_you_mean

# Values of one input outside its range that an error lists.
_SHOWN_VALUES = 8


@dataclass(frozen=True, slots=True)
class Dimension:
    """One coordinate of the vector form."""

    name: str  # name of the input or parameter
    time: float | None  # time of the control point in s; None for a parameter
    low: float  # lower bound
    high: float  # upper bound
    scale: Scale = "linear"  # that of the range


@dataclass(frozen=True, slots=True, repr=False)
class SearchSpace:
    """Everything that may be varied.

    Attributes:
        inputs: searched input signals.
        parameters: searched parameters.
        stop_time: end of the simulation in s.

    Raises:
        SpecError: if the stop time is not positive or shorter than an input's period, or names are equal.
    """

    inputs: tuple[InputRange, ...]
    parameters: tuple[ParameterRange, ...]
    stop_time: float

    def __post_init__(self) -> None:
        positive("stop_time", self.stop_time)
        for ranges, kind in ((self.inputs, InputRange), (self.parameters, ParameterRange)):
            if not isinstance(ranges, tuple) or not all(isinstance(r, kind) for r in ranges):
                raise SpecError(f"search space: expected a tuple of {kind.__name__}, got {ranges!r}")
        for name in self.names:
            if self.names.count(name) > 1:
                raise SpecError(f"search space: {name!r} has two ranges; keep one")
        periods = [(r, "hold", r.hold or 0.0) for r in self.inputs]
        periods += [(r, "free: min_interval", r.free.min_interval) for r in self.inputs if r.free]
        for r, what, period in periods:
            if period > self.stop_time:
                end = f"the simulation of {self.stop_time:.10g} s"
                raise SpecError(f"{r.label}: {what}: {period:g} s is longer than {end}; shorten it")

    def __repr__(self) -> str:
        searched = ", ".join(f"{r.name} in [{r.low:g}, {r.high:g}]{r.manner}" for r in self.ranges)
        return f"<SearchSpace: {searched}; {self.stop_time:.10g} s>"

    @property
    def ranges(self) -> tuple[InputRange | ParameterRange, ...]:
        """The inputs, then the parameters."""
        return (*self.inputs, *self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the inputs, then of the parameters."""
        return tuple(r.name for r in self.ranges)

    @property
    def fixed(self) -> "SearchSpace":
        """The same space, with only the control points of the spec allowed."""
        return replace(self, inputs=tuple(replace(r, free=None) for r in self.inputs))

    def freed(self, shortest: float) -> "SearchSpace":
        """Return the same space in which control points of every input are at least this far apart, in s.

        Raises:
            SpecError: if this is not positive, or longer than the simulation.
        """
        if not 0 < shortest <= self.stop_time:
            raise SpecError(
                f"the shortest piece of an input must be positive and at most the stop time of "
                f"{self.stop_time:.12g} s, got {shortest:.12g} s"
            )
        most = max(1, int(self.stop_time / shortest + 1e-9))
        changes = ((r, min(r.control_points, most)) for r in self.inputs)
        free = Freedom(most, shortest)
        return replace(self, inputs=tuple(replace(r, control_points=n, free=free) for r, n in changes))

    @property
    def dimensions(self) -> tuple[Dimension, ...]:
        """Coordinates of the vector form: control points input by input in time order, then parameters."""
        points = (Dimension(r.name, t, r.low, r.high) for r in self.inputs for t in self.fixed_times(r))
        return (*points, *(Dimension(p.name, None, p.low, p.high, p.scale) for p in self.parameters))

    @property
    def candidates(self) -> float:
        """Number of different candidates; infinite if a real one varies, or control points may be chosen."""
        if any(r.free for r in self.inputs):
            return inf
        counts = {r.name: len(r.numbers) if r.items else r.high - r.low + 1 for r in self.ranges}
        counts |= {r.name: inf for r in self.ranges if r.kind == "real" and r.low < r.high}
        return prod((counts[d.name] for d in self.dimensions), start=1.0)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Bounds of the vector form, shape (d, 2)."""
        return np.array([(d.low, d.high) for d in self.dimensions], dtype=np.float64).reshape(-1, 2)

    def fixed_times(self, r: InputRange) -> tuple[float, ...]:
        """Return the times in s of the control points that the spec defines for an input."""
        return even_times(r.control_points, stop_time=self.stop_time, interpolation=r.interpolation)

    def fixed_values(self, r: InputRange, signal: Signal) -> tuple[float, ...]:
        """Return the values of a signal at the times of the control points that the spec defines."""
        times = self.fixed_times(r)
        sampled = signal.times != times
        return tuple(signal.held(None).sample(np.asarray(times)).tolist()) if sampled else signal.values

    def is_fixed(self, r: InputRange, signal: Signal) -> bool:
        """Whether a signal has the control points of the spec, not some that an engine chose."""
        return signal.interpolation == r.interpolation and signal.times == self.fixed_times(r)

    def decode(
        self, vector: Sequence[float] | NDArray[np.float64], *, origin: str = "", rationale: str = ""
    ) -> Candidate:
        """Return the candidate for a point of the box, shape (d,).

        Raises:
            CandidateError: if the length is wrong, a number is NaN, or outside the box by more than rounding.
        """
        values = [float(v) for v in vector]
        expected = sum(r.control_points for r in self.inputs) + len(self.parameters)
        got = next((v for v in values if not isfinite(v)), len(values))
        if got != expected:
            raise CandidateError(f"expected {expected} finite numbers, got {got}")
        signals = {}
        start = 0
        for r in self.inputs:
            end = start + r.control_points
            signals[r.name] = Signal(self.fixed_times(r), tuple(values[start:end]), r.interpolation, r.hold)
            start = end
        parameters = {p.name: v for p, v in zip(self.parameters, values[start:], strict=True)}
        return self.admit(Candidate(signals, parameters, origin, rationale))

    def encode(self, candidate: Candidate) -> NDArray[np.float64]:
        """Return the vector form of a candidate, shape (d,); free signals are sampled at the fixed times."""
        points = [v for r in self.inputs for v in self.fixed_values(r, candidate.signals[r.name])]
        parameters = [candidate.parameters[p.name] for p in self.parameters]
        return np.array([*points, *parameters], dtype=np.float64)

    def check(self, candidate: Candidate) -> None:
        """Check that a candidate has a value for all that is searched, and none outside its range.

        Raises:
            CandidateError: naming an input or parameter that is unknown, and all missing or out of range.
        """
        unknown = [name for name in (*candidate.signals, *candidate.parameters) if name not in self.names][:1]
        wrong = [f"unknown input or parameter {n!r}; {did_you_mean(n, self.names)}" for n in unknown]
        missing: list[Range] = [r for r in self.inputs if r.name not in candidate.signals]
        missing += [p for p in self.parameters if p.name not in candidate.parameters]
        wrong += [f"{r.label} is missing" for r in missing]
        if wrong := [*wrong, *self.outside(candidate)]:
            raise CandidateError("; ".join(wrong))

    def outside(self, candidate: Candidate) -> list[str]:
        """Say what is outside its range, of the inputs and parameters that the candidate has."""
        signals, values = candidate.signals, candidate.parameters
        found = [_signal_outside(r, signals[r.name]) for r in self.inputs if r.name in signals]
        for p in self.parameters:
            if p.name in values and is_outside(p, value := values[p.name]):
                found.append(f"{p.label}: {value:.12g} is {outside_text(p)}")
        return [each for each in found if each]

    def admit(self, candidate: Candidate) -> Candidate:
        """Return the candidate as it will be simulated.

        Values outside their range by no more than a rounding error are clipped; integers, Booleans and
        enumerations are rounded to the nearest allowed number; each input gets its hold.

        Raises:
            CandidateError: as of ``check``, or naming all inputs whose control points are not allowed.
        """
        self.check(candidate)
        times, unfit = dict[str, tuple[float, ...]](), list[str]()
        for r in self.inputs:
            try:
                times[r.name] = self._admitted_times(r, candidate.signals[r.name])
            except CandidateError as error:
                unfit.append(str(error))
        if unfit:
            raise CandidateError("; ".join(unfit))
        signals = {r.name: _admitted_signal(r, times[r.name], candidate.signals[r.name]) for r in self.inputs}
        parameters = {p.name: into_range(candidate.parameters[p.name], p) for p in self.parameters}
        return replace(candidate, signals=signals, parameters=parameters)

    def _admitted_times(self, r: InputRange, signal: Signal) -> tuple[float, ...]:
        """Times of the control points as they will be simulated."""
        fixed = self.fixed_times(r)
        if signal.interpolation == r.interpolation and len(signal.times) == len(fixed):
            rounding = 1e-9 * self.stop_time
            if all(abs(a - b) <= rounding for a, b in zip(signal.times, fixed, strict=True)):
                return fixed
        _check_freedom(r, signal, self.stop_time)
        return signal.times


def _admitted_signal(r: InputRange, times: tuple[float, ...], signal: Signal) -> Signal:
    values = signal.values
    if r.kind != "real" or min(values) < r.low or max(values) > r.high:
        values = tuple(into_range(v, r) for v in values)
    if (times, values, r.hold) == (signal.times, signal.values, signal.hold):
        return signal
    return Signal(times, values, signal.interpolation, r.hold)


def _check_freedom(r: InputRange, signal: Signal, stop_time: float) -> None:
    count = len(signal.times)
    if r.free is None:
        expected = f"{r.control_points} evenly spaced control points with {r.interpolation} interpolation"
        got = f"{count} with {signal.interpolation}"
        if count == r.control_points and signal.interpolation == r.interpolation:
            even = even_times(count, stop_time=stop_time, interpolation=r.interpolation)
            given, time = max(zip(signal.times, even, strict=True), key=lambda pair: abs(pair[0] - pair[1]))
            got = f"one at {given:.9g} s instead of {time:.9g} s"
        raise CandidateError(f"{r.label}: expected {expected}, got {got}")
    if r.kind != "real" and signal.interpolation != "constant" and count > 1:
        raise CandidateError(
            f"{r.label}: values of type {r.kind} cannot have {signal.interpolation} interpolation; "
            f'use "constant"'
        )
    if count > (most := r.free.max_control_points):
        raise CandidateError(f"{r.label}: {count} control points; at most {most} are allowed")
    gaps = np.diff(signal.times)
    if gaps.size and gaps.min() < r.free.min_interval * (1 - 1e-6):
        k = int(gaps.argmin())
        raise CandidateError(
            f"{r.label}: control points at {signal.times[k]:.12g} s and {signal.times[k + 1]:.12g} s are "
            f"less than {r.free.min_interval:.12g} s apart"
        )
    if signal.times[-1] > stop_time * (1 + 1e-9):
        raise CandidateError(
            f"{r.label}: the control point at {signal.times[-1]:.12g} s is after the stop time, "
            f"{stop_time:.12g} s"
        )


def _signal_outside(r: InputRange, signal: Signal) -> str:
    """What is outside the range of an input; empty if nothing is."""
    values = signal.values
    found = [(t, v) for t, v in zip(signal.times, values, strict=True) if is_outside(r, v)]
    if not found:
        return ""
    if len(set(values)) == 1 < len(values):
        return f"{r.label}: {values[0]:.12g} is {outside_text(r)}"
    shown = found[:_SHOWN_VALUES]
    more = f" and {len(found) - len(shown)} more" if len(found) > len(shown) else ""
    at, what = (", ".join(f"{pair[k]:.12g}" for pair in shown) for k in (0, 1))
    verb = "is" if len(found) == 1 else "are"
    return f"{r.label} at t = {at} s{more}: {what}{more} {verb} {outside_text(r)}"
