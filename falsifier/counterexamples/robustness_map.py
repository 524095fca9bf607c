"""The neighbourhood of a simulation: how far a violation extends, or whether one is near.

The values of each input, one per stretch of equal values, and the parameters are changed; times and
interpolation are not. The size of a change is the largest share of a range by which any value changes.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import isqrt

import numpy as np
from numpy.typing import NDArray

from falsifier.core.arguments import whole
from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Scale, nearest_numbers
from falsifier.core.words import counted, listed, readable, with_unit
from falsifier.counterexamples.shrink import sampled_stretches, with_parameter, with_signal, with_stretch
from falsifier.errors import SpecError, setting
from falsifier.evaluation.evaluate import Evaluation, check_evaluation, evaluate
from falsifier.problem.problem import Problem
from falsifier.stl.margins import signed

# Simulations of a map, and the share of them on its grid.
BUDGET = 700
_GRID_SHARE = 0.63
# With fewer, there is no grid of two points by two.
_LEAST_BUDGET = 7
# Maximum sizes of the changes as shares of the radius; each is used for an equal part of the samples.
_SHELLS = (0.125, 0.25, 0.5, 1.0)
# Error of rounding in a share of the range of a whole number, up to which it is a change of one.
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One value that is changed.

    Attributes:
        name: name of the input or parameter.
        stretch: index of its first control point, and the index after its last one; None for a parameter.
        time: time of the first control point in s; None for a parameter or a constant signal.
        value: value without a change.
        low: lower bound.
        high: upper bound.
        unit: unit of the value.
        scale: ``log`` if changes are shares of the range's decades.
    """

    name: str
    stretch: tuple[int, int] | None
    time: float | None
    value: float
    low: float
    high: float
    unit: str = ""
    scale: Scale = "linear"

    @property
    def label(self) -> str:
        """Name, time and unit."""
        at = "" if self.time is None else f" from {readable(self.time, 4)} s"
        return with_unit(f"{self.name}{at}", self.unit)


@dataclass(frozen=True, slots=True, eq=False)
class RobustnessMap:
    """Simulations around a counterexample or a near miss.

    Attributes:
        original: robustness of the counterexample; not negative for a near miss.
        coordinates: the values that are changed; none that the radius leaves as they are.
        radius: largest change as a share of the range.
        values: values of the coordinates, shape (samples, coordinates).
        sizes: size of each sample's change as a share of the range, shape (samples,).
        robustness: robustness of each sample, shape (samples,); NaN if the simulation failed.
        influences: rank correlation of each coordinate with the robustness, -1 to 1, by the ranks within a
            shell; 0 if one of them does not vary.
        axes: indices of the two coordinates with the largest; one if there is only one.
        grid: values of these coordinates, one array each.
        surface: robustness over the grid, with the other coordinates unchanged, shape
            (len(grid[1]), len(grid[0])), or (1, len(grid[0])) with one axis; NaN if it was not simulated.
        interrupted: whether the user stopped it before all was simulated.
    """

    original: float
    coordinates: tuple[Coordinate, ...]
    radius: float
    values: NDArray[np.float64]
    sizes: NDArray[np.float64]
    robustness: NDArray[np.float64]
    influences: tuple[float, ...]
    axes: tuple[int, ...]
    grid: tuple[NDArray[np.float64], ...]
    surface: NDArray[np.float64]
    interrupted: bool = False

    @property
    def persistence(self) -> tuple[tuple[float, float], ...]:
        """Pairs of a size and the share of the changes up to that size that still violate."""
        sizes = [shell * self.radius for shell in _SHELLS]
        within = [self.robustness[self.sizes <= size * (1 + 1e-9)] for size in sizes]
        most = self.sizes.max(initial=0.0)  # larger ones were not tried if the user stopped it
        tried = zip((0.0, *sizes), sizes, within, strict=False)
        return tuple((size, float((r < 0).mean())) for below, size, r in tried if r.size and most > below)

    @property
    def smallest(self) -> float | None:
        """Smallest robustness of a change; None if all simulations failed."""
        known = self.robustness[np.isfinite(self.robustness)]
        return float(known.min()) if known.size else None

    @property
    def text(self) -> str:
        """How far the violation extends, or whether one is near, in words."""
        changes = counted(len(self.robustness), "random change")
        if self.original < 0:
            (size, share), *larger = self.persistence
            shares = f"{_rounded(share)} % of those up to {_percent(size)} of the range still violate"
            shares += "".join(f", {_rounded(share)} % up to {_percent(size)}" for size, share in larger)
            names = listed(list(dict.fromkeys(c.name for c in self.coordinates)))
            return f"of {changes} of {names} at once, {shares}. {self._followed}"
        tried = f"{changes} of up to {_percent(self.persistence[-1][0])} of the range"
        violating = int((self.robustness < 0).sum())
        found = f"{violating or 'none'} of {tried} violate{'s' if violating < 2 else ''}"
        least = "" if self.smallest is None else f"; the smallest robustness is {signed(self.smallest)}"
        return f"{found}{least}, without a change it is {signed(self.original)}. {self._followed}"

    @property
    def _followed(self) -> str:
        """What was measured, so that it is not taken for what resetting one input alone would do."""
        known = self.robustness[~np.isnan(self.robustness)]
        failed = len(self.robustness) - len(known)
        end = f" {counted(failed, 'simulation')} failed and counted as no violation." if failed else ""
        end += " Stopped by the user." if self.interrupted else ""
        if known.size and (known == self.original).all():
            return f"None of these changes moved the robustness.{end}"
        told = [(self.coordinates[i].label, f"{self.influences[i]:+.2f}") for i in self.axes]
        most = [f"{label} ({number})" for label, number in told if float(number)]
        named = f"most with {listed(most)}" if most else "with none of these values"
        return f"Over these changes the robustness correlates {named} (rank correlation).{end}"


def robustness_map(
    problem: Problem, evaluation: Evaluation, *, radius: float = 0.05, budget: int = BUDGET, seed: int = 0
) -> RobustnessMap:
    """Simulate around a counterexample or a near miss; Ctrl-C ends it early, with what is simulated by then.

    Args:
        problem: the problem with the requirement.
        evaluation: the counterexample, or the nearest miss.
        radius: largest change as a share of the range.
        budget: maximum number of simulations: with all coordinates changed at once, from a scrambled Sobol
            sequence, and on a grid of the two most influential coordinates.
        seed: seed of the sequence.

    Raises:
        SpecError: for a failed simulation, a radius outside (0, 1] or without effect, or too small a budget.
    """
    check_evaluation(problem, evaluation)
    if evaluation.robustness is None:
        raise SpecError(f"{problem.name}: a failed simulation has no robustness to map around")
    if not 0 < radius <= 1:
        raise SpecError(f"radius: expected a share of the ranges, above 0 and up to 1, got {radius:.12g}")
    points = isqrt(int(_GRID_SHARE * whole(setting("budget"), budget, least=_LEAST_BUDGET)))
    samples = budget - points * points
    from scipy.stats.qmc import Sobol

    candidate = evaluation.candidate
    discrete = {r.name: r for r in problem.space.ranges if r.kind != "real"}
    coordinates = tuple(
        c
        for c in _coordinates(problem, candidate)
        if c.low < c.high and (c.name not in discrete or radius * (c.high - c.low) >= 1 - _ROUNDING)
    )
    if not coordinates:
        change = f"{_percent(radius)} of a range changes none of the values"
        raise SpecError(f"{problem.name}: {change}; in Python, robustness_map accepts a larger radius")
    start, low, high = np.array([(c.value, c.low, c.high) for c in coordinates]).T
    logs = np.array([c.scale == "log" for c in coordinates])
    start, low, high = (np.log(numbers, where=logs, out=numbers) for numbers in (start, low, high))
    reach, is_whole = radius * (high - low), np.array([c.name in discrete for c in coordinates])
    reach[is_whole] = np.floor(reach[is_whole] + _ROUNDING)
    unit = Sobol(len(coordinates), seed=seed).random_base2((samples - 1).bit_length())[:samples]
    # One block of samples per shell: alternating shells would correlate with the bits of the Sobol sequence.
    shells = np.arange(samples) * len(_SHELLS) // samples
    shell = np.array(_SHELLS)[shells, np.newaxis] * reach
    below, above = np.maximum(start - shell, low), np.minimum(start + shell, high)
    values = below + unit * (above - below)
    for k in np.flatnonzero(is_whole):
        near = nearest_numbers(discrete[coordinates[k].name], values[:, k])
        values[:, k] = np.where(np.abs(near - start[k]) <= reach[k], near, start[k])
    changed = (values != start).any(axis=1)
    values, shells, samples = values[changed], shells[changed], int(changed.sum())
    if not samples:
        raise SpecError(f"{setting('budget')}: {budget} simulations are too few to change a whole number")
    sizes = np.abs((values - start) / (high - low)).max(axis=1)
    values = np.exp(values, where=logs, out=values)
    robustness = np.array(_simulated(problem, candidate, coordinates, values))
    if not robustness.size:
        raise KeyboardInterrupt
    values, sizes = values[: robustness.size], sizes[: robustness.size]
    influences = _influences(values, robustness, shells[: robustness.size])
    axes = tuple(int(i) for i in np.argsort(-np.abs(influences), kind="stable")[:2])
    grid = tuple(
        np.linspace(max(start[i] - reach[i], low[i]), min(start[i] + reach[i], high[i]), points) for i in axes
    )
    rows = np.tile(start, (points ** len(axes), 1))
    # The second axis first, so that the first one varies along the rows of the surface.
    rows[:, axes[::-1]] = np.stack(np.meshgrid(*grid[::-1], indexing="ij"), axis=-1).reshape(-1, len(axes))
    rows = np.exp(rows, where=logs, out=rows)[: len(rows) if robustness.size == samples else 0]
    judged = _simulated(problem, candidate, coordinates, rows)
    surface = np.array(judged + [np.nan] * (points ** len(axes) - len(judged)))
    return RobustnessMap(
        evaluation.robustness,
        coordinates,
        radius,
        values,
        sizes,
        robustness,
        tuple(influences.tolist()),
        axes,
        tuple(np.exp(numbers) if logs[i] else numbers for i, numbers in zip(axes, grid, strict=True)),
        surface.reshape(-1, points),
        interrupted=len(judged) < len(surface),
    )


def _rounded(share: float) -> int:
    """Return a share in percent: 0 only if it is none, 100 only if it is all."""
    return min(max(round(100 * share), share > 0), 100 - (share < 1))


def _percent(size: float) -> str:
    """Share of a range as a percentage.

    >>> _percent(0.00625), _percent(0.025), _percent(1.0)
    ('0.6 %', '2.5 %', '100 %')
    """
    return f"{100 * size:.{1 if size < 0.01 else 3}g} %"


def _coordinates(problem: Problem, candidate: Candidate) -> Iterator[Coordinate]:
    for r in problem.space.inputs:
        signal = candidate.signals[r.name]
        found = sampled_stretches(signal, problem.space.stop_time)
        for first, end in found:
            time = signal.moments[first] if len(found) > 1 else None
            yield Coordinate(r.name, (first, end), time, signal.values[first], r.low, r.high, r.unit)
    for p in problem.space.parameters:
        yield Coordinate(p.name, None, None, candidate.parameters[p.name], p.low, p.high, p.unit, p.scale)


def _simulated(
    problem: Problem, candidate: Candidate, coordinates: Sequence[Coordinate], rows: NDArray[np.float64]
) -> list[float]:
    """Return the robustness for each row of values; until Ctrl-C, for those that were simulated."""
    found: list[float] = []
    with suppress(KeyboardInterrupt):
        for row in rows.tolist():
            changed = candidate
            for c, value in zip(coordinates, row, strict=True):
                if c.stretch is None:
                    changed = with_parameter(changed, c.name, value)
                else:
                    signal = with_stretch(changed.signals[c.name], *c.stretch, value)
                    changed = with_signal(changed, c.name, signal)
            robustness = evaluate(problem, problem.space.admit(changed)).robustness
            found.append(np.nan if robustness is None else robustness)
    return found


def _influences(
    values: NDArray[np.float64], robustness: NDArray[np.float64], shells: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Rank correlation of each column of values, shape (samples, coordinates), with the robustness."""
    from scipy.stats import rankdata

    known = np.isfinite(robustness)
    if known.sum() < 2:
        return np.zeros(values.shape[1])
    table = np.column_stack((values, robustness))
    shells = shells * (known.sum() >= 4 * len(_SHELLS))  # of one or two in a shell, ranks say nothing
    # By shell: away from a bound, all values move the farther the larger it is, whatever they have effect on.
    blocks = (table[known & (shells == k)] for k in range(len(_SHELLS)))
    ranks = np.concatenate([rankdata(block, axis=0) - (len(block) + 1) / 2 for block in blocks])
    with np.errstate(invalid="ignore"):  # what does not vary has no correlation
        return np.asarray(np.nan_to_num(np.corrcoef(ranks, rowvar=False)[-1, :-1]))
