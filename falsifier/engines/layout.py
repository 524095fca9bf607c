"""The parameterizations in which engines search, as vectors in [0, 1]^d, and the time grid of their cells."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Freedom, InputRange, nearest_numbers
from falsifier.core.signals import Interpolation, Signal, even_times
from falsifier.core.space import SearchSpace
from falsifier.problem.problem import Problem

# Single precision in the rollout of learnt dynamics, double precision elsewhere.
Array = NDArray[np.floating[Any]]
# Engines learn from numbers up to this one: products of larger ones overflow in single precision.
_LARGEST = 1e25
# Cells over the formula's horizon on which free inputs are held and outputs predicted: enough for pieces of
# 1 % of the horizon, few enough for a roll-out in milliseconds.
CELLS = 100
# Maximum number of held cells of an input that are few: searched as the spec's control points, such inputs
# need fewer simulations (design/search-evidence.md).
_FEW_CELLS = 10
# Maximum length of the grid in horizons of the formula; later times contribute little to the dynamics.
_MAX_HORIZONS = 20


def learnable(numbers: ArrayLike) -> NDArray[np.float64]:
    """Return numbers, of any shape, with infinite and huge ones cut to what can be calculated with."""
    return np.clip(np.asarray(numbers, dtype=np.float64), -_LARGEST, _LARGEST)


@dataclass(frozen=True, slots=True)
class TimeGrid:
    """Evenly spaced times from 0 over the formula's horizon, and on to the end of the simulation."""

    step: float  # in s
    cells: int  # number over the horizon
    all_cells: int  # complete ones until the end of the simulation, at most twenty horizons

    @classmethod
    def of(cls, problem: Problem, *, cells: int = CELLS) -> "TimeGrid":
        """Return the grid over the horizon of a requirement, with fewer cells if these were too short."""
        interval, stop_time = problem.experiment.output_interval, problem.space.stop_time
        horizon = problem.requirement.formula.horizon(interval)
        horizon = min(horizon, stop_time) if horizon > 0 else stop_time
        count = max(1, min(cells, round(horizon / interval)))
        step = horizon / count
        return cls(step, count, max(count, min(int(stop_time / step + 1e-6), _MAX_HORIZONS * count)))

    @property
    def middles(self) -> Array:
        """Middle times of the horizon's cells in s, shape (cells,)."""
        return np.asarray((np.arange(self.cells) + 0.5) * self.step)


@dataclass(frozen=True, slots=True)
class Coding:
    """The coordinates of one input."""

    times: tuple[float, ...]  # control-point times in s
    interpolation: Interpolation  # interpolation between them
    free: bool  # whether it consists of held cells, or of the spec's control points


@dataclass(frozen=True)
class Layout:
    """Codings of all inputs, in the space's order, followed by one coordinate per parameter."""

    space: SearchSpace
    codings: tuple[Coding, ...]  # one coding per input

    @cached_property
    def groups(self) -> tuple[NDArray[np.intp], ...]:
        """Indices of the coordinates of each input and each parameter."""
        counts = [*(len(c.times) for c in self.codings), *(1 for _ in self.space.parameters)]
        ends = np.cumsum(counts)
        return tuple(np.arange(end - count, end) for count, end in zip(counts, ends, strict=True))

    @cached_property
    def dimension(self) -> int:
        """Number of coordinates d."""
        return sum(len(g) for g in self.groups)

    @cached_property
    def is_fine(self) -> tuple[bool, ...]:
        """Whether each group consists of many held cells, most of them equal to their neighbours.

        A few vary independently, as the spec's control points do.
        """
        fine = (c.free and len(c.times) > _FEW_CELLS for c in self.codings)
        return (*fine, *(False for _ in self.space.parameters))

    @cached_property
    def starts(self) -> NDArray[np.float64]:
        """Time in s from which on each coordinate has an effect, shape (d,); parameters: 0."""
        parts = []
        for coding in self.codings:
            times = np.asarray(coding.times)
            # Of a pchip curve, a control point also sets the slope at the one before it.
            back = {"constant": 0, "linear": 1, "pchip": 2}[coding.interpolation]
            parts.append(times[np.maximum(np.arange(len(times)) - back, 0)])
        parts.append(np.zeros(len(self.space.parameters)))
        return np.concatenate(parts)

    @cached_property
    def has_gaps(self) -> bool:
        """Whether some points stand for the same candidate, because not every level of a range is a value."""
        return any(r.kind != "real" or r.low == r.high for r in self.space.ranges)

    def settled(self, points: Array) -> Array:
        """Return the points, shape (..., d), that the candidates of these points have.

        Integers, Booleans and enumerations are at the nearest number, what cannot vary is at 0.
        """
        if not self.has_gaps:
            return points
        result = np.array(points, dtype=np.float64)
        for r, group in zip(self.space.ranges, self.groups, strict=True):
            if r.low == r.high:
                result[..., group] = 0.0
            elif r.kind != "real":
                values = r.at(np.clip(result[..., group], 0.0, 1.0))
                result[..., group] = r.share_of(nearest_numbers(r, values))
        return result

    def inputs(self, points: Array, grid: TimeGrid) -> Array:
        """Return scaled inputs and parameters in the horizon's cells for m points, (m, cells, groups)."""
        values = np.empty((len(points), grid.cells, len(self.groups)))
        for j, group in enumerate(self.groups):
            own = points[:, group]
            values[:, :, j] = _read(self.codings[j], own, grid.middles) if j < len(self.codings) else own
        return values

    def candidate(self, point: Array, *, origin: str, rationale: str) -> Candidate:
        """Return the candidate for a point; equal neighbours among held cells are merged into one piece."""
        point = np.clip(point, 0.0, 1.0)
        signals = {}
        for r, coding, group in zip(self.space.inputs, self.codings, self.groups, strict=False):
            values = r.at(point[group])
            keep = np.ones(len(values), dtype=bool)
            if coding.free:
                keep[1:] = values[1:] != values[:-1]
            times = np.asarray(coding.times)[keep]
            signals[r.name] = Signal(
                tuple(float(t) for t in times), tuple(float(v) for v in values[keep]), coding.interpolation
            )
        scalars = point[len(point) - len(self.space.parameters) :]
        parameters = {p.name: float(p.at(v)) for p, v in zip(self.space.parameters, scalars, strict=True)}
        return self.space.admit(Candidate(signals, parameters, origin, rationale))

    def represents(self, candidate: Candidate) -> bool:
        """Whether all signals have the control points of this layout, so that a point stands for them."""
        signals = [candidate.signals[r.name] for r in self.space.inputs]
        own = [(coding.times, coding.interpolation) for coding in self.codings]
        return [(signal.times, signal.interpolation) for signal in signals] == own

    def point(self, candidate: Candidate) -> Array:
        """Return the point whose signals have the candidate's values at this layout's control points."""
        parts = []
        for r, coding in zip(self.space.inputs, self.codings, strict=True):
            at = np.asarray(coding.times)
            if coding.free:
                # A cell is represented by its middle.
                at = at + 0.5 * (at[1] - at[0] if len(at) > 1 else 0.0)
            signal = candidate.signals[r.name]
            values = np.asarray(
                signal.values if signal.times == coding.times else signal.held(None).sample(at)
            )
            parts.append(r.share_of(values))
        for p in self.space.parameters:
            parts.append(np.array([p.share_of(candidate.parameters[p.name])]))
        return np.asarray(np.clip(np.concatenate(parts), 0.0, 1.0))


def fixed_layout(space: SearchSpace) -> Layout:
    """Return the layout with the spec's control points."""
    return Layout(space, tuple(_fixed(space, r) for r in space.inputs))


def planning_layout(space: SearchSpace, grid: TimeGrid) -> Layout:
    """Return the layout with held cells for free inputs and the spec's control points for fixed ones."""
    return Layout(
        space,
        tuple(
            _fixed(space, r) if r.free is None else _held(grid.step * grid.cells, grid.cells, r.free)
            for r in space.inputs
        ),
    )


def _fixed(space: SearchSpace, r: InputRange) -> Coding:
    return Coding(space.fixed_times(r), r.interpolation, free=False)


def _held(horizon: float, count: int, free: Freedom) -> Coding:
    count = max(1, min(count, free.max_control_points, int(horizon / free.min_interval + 1e-6)))
    return Coding(even_times(count, stop_time=horizon, interpolation="constant"), "constant", free=True)


def _read(coding: Coding, values: Array, at: Array) -> Array:
    """Return the values, shape (m, times), of m signals, given as shape (m, points), at times in s."""
    knots = np.asarray(coding.times)
    if len(knots) == 1:
        return np.repeat(values, len(at), axis=1)
    at = np.clip(at, knots[0], knots[-1])
    if coding.interpolation == "constant":
        return np.asarray(values[:, np.searchsorted(knots, at, side="right") - 1])
    if coding.interpolation == "linear":
        return values @ np.stack([np.interp(at, knots, row) for row in np.eye(len(knots))])
    from scipy.interpolate import PchipInterpolator

    return np.asarray(np.clip(PchipInterpolator(knots, values, axis=1)(at), 0.0, 1.0))
