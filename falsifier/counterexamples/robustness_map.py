"""The neighbourhood of a counterexample: how far its inputs may move before the violation is gone.

What moves are the stretches of equal values of each input, and the parameters; times and interpolation stay.
Changes are measured as shares of the ranges, the largest of them counts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.counterexamples.shrink import stretches, with_signal
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem

# Sizes of the changes as shares of the radius: each takes its part of the samples.
_SHELLS = (0.125, 0.25, 0.5, 1.0)


@dataclass(frozen=True, slots=True)
class Coordinate:
    """Something that moves.

    Attributes:
        name: of the input or parameter.
        first: index of the stretch's first control point; None for a parameter.
        end: index behind its last one.
        time: of the first control point in s, None for a parameter or a constant signal.
        value: in the counterexample.
        low: lower bound.
        high: upper bound.
        unit: of the value.
    """

    name: str
    first: int | None
    end: int | None
    time: float | None
    value: float
    low: float
    high: float
    unit: str = ""

    @property
    def label(self) -> str:
        """Name, time and unit."""
        at = "" if self.time is None else f" from {self.time:.4g} s"
        return f"{self.name}{at}" + (f" [{self.unit}]" if self.unit else "")


@dataclass(frozen=True, slots=True, eq=False)
class RobustnessMap:
    """Simulations around a counterexample.

    Attributes:
        original: robustness of the counterexample.
        coordinates: what moved.
        radius: largest change as a share of the range.
        values: of the coordinates, shape (samples, coordinates).
        sizes: largest change of each sample as a share of its range, shape (samples,).
        robustness: of each sample, NaN where the simulation failed, shape (samples,).
        axes: indices of the two coordinates that decide most; one where there is only one.
        grid: values of these two, one array each.
        surface: robustness over the grid, the others unchanged, shape (len(grid[1]), len(grid[0])) or, with
            one axis, (1, len(grid[0])).
    """

    original: float
    coordinates: tuple[Coordinate, ...]
    radius: float
    values: NDArray[np.float64]
    sizes: NDArray[np.float64]
    robustness: NDArray[np.float64]
    axes: tuple[int, ...]
    grid: tuple[NDArray[np.float64], ...]
    surface: NDArray[np.float64]

    @property
    def persistence(self) -> tuple[tuple[float, float], ...]:
        """Pairs of a size and the share of the samples up to it that still violate."""
        sizes = [shell * self.radius for shell in _SHELLS]
        within = [self.robustness[self.sizes <= size * (1 + 1e-9)] for size in sizes]
        return tuple((size, float((r < 0).mean())) for size, r in zip(sizes, within, strict=True) if r.size)

    @property
    def text(self) -> str:
        """How far the violation reaches, in words."""
        shares = ", ".join(f"{share:.0%} up to {size:.3g}" for size, share in self.persistence)
        names = " and ".join(self.coordinates[i].label for i in self.axes)
        return (
            f"Of {len(self.robustness)} changes of all inputs at once, still violating: {shares} of the "
            f"range; what decides most: {names}."
        )


def robustness_map(
    problem: Problem,
    evaluation: Evaluation,
    *,
    radius: float = 0.05,
    samples: int = 256,
    points: int = 21,
    seed: int = 0,
) -> RobustnessMap:
    """Simulate around a counterexample.

    Args:
        problem: what it violates.
        evaluation: the counterexample.
        radius: largest change as a share of the range.
        samples: simulations with all coordinates changed at once, by a scrambled Sobol sequence.
        points: of the grid along each of the two coordinates that decide most.
        seed: of the sequence.

    Raises:
        SpecError: for a failed simulation, or a radius, samples or points that are not positive.
    """
    if evaluation.robustness is None:
        raise SpecError(f"{problem.name}: a simulation that failed has no neighbourhood")
    if not 0 < radius <= 1 or samples < 1 or points < 2:
        raise SpecError("expected 0 < radius <= 1, at least one sample and at least two grid points")
    from scipy.stats.qmc import Sobol

    candidate = evaluation.candidate
    coordinates = tuple(_coordinates(problem, candidate))
    start, low, high = (
        np.array([getattr(c, name) for c in coordinates]) for name in ("value", "low", "high")
    )
    reach = radius * (high - low)
    unit = Sobol(len(coordinates), seed=seed).random_base2((samples - 1).bit_length())[:samples]
    # Block by block: taken in turn, the shells would fall together with the binary digits of the sequence.
    shell = np.array(_SHELLS)[np.arange(samples) * len(_SHELLS) // samples, np.newaxis] * reach
    below, above = np.maximum(start - shell, low), np.minimum(start + shell, high)
    values = below + unit * (above - below)
    sizes = np.abs((values - start) / (high - low)).max(axis=1)
    robustness = np.array([_robustness(problem, candidate, coordinates, row) for row in values])
    axes = _deciding(values - start, robustness)
    grid = tuple(
        np.linspace(max(start[i] - reach[i], low[i]), min(start[i] + reach[i], high[i]), points) for i in axes
    )
    surface = []
    for second in grid[1] if len(grid) > 1 else (None,):
        for first in grid[0]:
            row = start.copy()
            row[axes[0]] = first
            if second is not None:
                row[axes[1]] = second
            surface.append(_robustness(problem, candidate, coordinates, row))
    return RobustnessMap(
        evaluation.robustness,
        coordinates,
        radius,
        values,
        sizes,
        robustness,
        axes,
        grid,
        np.array(surface).reshape(-1, points),
    )


def _coordinates(problem: Problem, candidate: Candidate) -> Iterator[Coordinate]:
    for r in problem.space.inputs:
        signal = candidate.signals[r.name]
        found = stretches(signal.values)
        for first, end in found:
            time = signal.times[first] if len(found) > 1 else None
            yield Coordinate(r.name, first, end, time, signal.values[first], r.low, r.high, r.unit)
    for p in problem.space.parameters:
        yield Coordinate(p.name, None, None, None, candidate.parameters[p.name], p.low, p.high, p.unit)


def _robustness(
    problem: Problem,
    candidate: Candidate,
    coordinates: Sequence[Coordinate],
    values: NDArray[np.float64],
) -> float:
    changed = candidate
    for c, value in zip(coordinates, values.tolist(), strict=True):
        if c.first is None or c.end is None:
            changed = replace(changed, parameters={**changed.parameters, c.name: value})
            continue
        signal = changed.signals[c.name]
        kept = signal.values[: c.first], signal.values[c.end :]
        moved = (*kept[0], *(value,) * (c.end - c.first), *kept[1])
        changed = with_signal(changed, c.name, replace(signal, values=moved))
    robustness = evaluate(problem, problem.space.admit(changed)).robustness
    return np.nan if robustness is None else robustness


def _deciding(changes: NDArray[np.float64], robustness: NDArray[np.float64]) -> tuple[int, ...]:
    """Indices of the two coordinates whose ranks go most with the robustness's."""
    known = np.isfinite(robustness)
    ranks = changes[known].argsort(axis=0).argsort(axis=0) - known.sum() / 2
    level = robustness[known].argsort().argsort() - known.sum() / 2
    influence = np.abs((ranks * level[:, np.newaxis]).sum(axis=0))
    return tuple(int(i) for i in np.argsort(-influence, kind="stable")[:2])
