"""Engines that learn nothing, or only which corner is best: the yardsticks of all others."""

from math import inf

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import BoxEngine, Proposal, Vector
from falsifier.problem.problem import Problem

# A corner: whether each input and parameter is constant at its highest value, 1, or its lowest one, 0.
Levels = tuple[int, ...]


class Uniform(BoxEngine):
    """Points drawn uniformly at random from the box."""

    name = "uniform"

    def _propose(self, rng: np.random.Generator) -> Proposal:
        return Proposal(rng.random(self.box.dimension), "uniform random")


class Sobol(BoxEngine):
    """Successive points of one scrambled Sobol sequence."""

    name = "sobol"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        super().__init__(problem, seed=seed)
        from scipy.stats import qmc

        # For more coordinates scipy has no direction numbers: they are drawn at random.
        count = min(self.box.dimension, qmc.Sobol.MAXDIM)
        self._sequence = qmc.Sobol(count, scramble=True, seed=np.random.default_rng(seed))

    def _propose(self, rng: np.random.Generator) -> Proposal:
        point = rng.random(self.box.dimension)
        point[: self._sequence.d] = self._sequence.random(1)[0]
        return Proposal(point, f"point {self._asked + 1} of a Sobol sequence")


class Corners(BoxEngine):
    """All corners of the inputs' and parameters' ranges, then uniform random points."""

    name = "corners"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        super().__init__(problem, seed=seed)
        varied = [
            (n, g) for n, g in zip(problem.space.names, self.box.groups, strict=True) if self._varies(g)
        ]
        self._names, self._groups = [n for n, _ in varied], [g for _, g in varied]
        self._walk = CornerWalk(len(self._groups))

    def _propose(self, rng: np.random.Generator) -> Proposal:
        levels = self._walk.next(rng)
        if levels is None:
            return Proposal(rng.random(self.box.dimension), "uniform random: all corners were tried")
        point = np.zeros(self.box.dimension)
        for indices, level in zip(self._groups, levels, strict=True):
            point[indices] = level
        words = ", ".join(
            f"{name} {'high' if level else 'low'}" for name, level in zip(self._names, levels, strict=True)
        )
        return Proposal(point, f"constant extremes: {words or 'nothing varies'}")

    @property
    def is_done(self) -> bool:
        """Whether all corners have been tried."""
        return self._walk.is_done

    def hear(self, point: Vector, cost: float) -> None:
        """Let a point near a corner stand for it: that one need not be simulated soon."""
        levels = self._levels(np.rint(point))
        if levels is not None:
            self._walk.heard(levels, cost)

    def _varies(self, indices: NDArray[np.intp]) -> bool:
        return bool(self.box.span[indices[0]] > 0.0)

    def _learn(self, point: Vector, cost: float | None) -> None:
        levels = self._levels(point)
        if levels is not None:
            self._walk.learn(levels, cost)

    def _levels(self, point: Vector) -> Levels | None:
        levels = []
        for indices in self._groups:
            value = point[indices[0]]
            if value not in (0.0, 1.0) or not (point[indices] == value).all():
                return None
            levels.append(int(value))
        return tuple(levels)


class CornerWalk:
    """Walks through the corners of a box with one coordinate per input and parameter.

    The first corner is random. Each of the next ones flips one level of the best corner so far, that of the
    input flipped least often. If the effects of the inputs are additive, this reaches the best corner after
    one simulation per input; an input without effect costs one simulation instead of half of all corners.
    """

    def __init__(self, groups: int) -> None:
        self.groups = groups
        self._costs: dict[Levels, float] = {}
        self._flips = np.zeros(groups, dtype=int)

    def next(self, rng: np.random.Generator) -> Levels | None:
        """Return the next corner's levels (0 low, 1 high) and count it as tried; None if all have been."""
        if not self._costs:
            levels: Levels = tuple(int(v) for v in rng.integers(0, 2, self.groups))
            self._costs[levels] = inf
            return levels
        for base in sorted(self._costs, key=lambda levels: self._costs[levels]):
            flips = self._flips + rng.random(self.groups)
            for group in np.argsort(flips):
                levels = _flipped(base, int(group))
                if levels not in self._costs:
                    self._flips[group] += 1
                    self._costs[levels] = inf
                    return levels
        return None

    def learn(self, levels: Levels, cost: float | None) -> None:
        """Learn the cost of a corner; None if its simulation failed."""
        self._costs[levels] = inf if cost is None else cost

    def heard(self, levels: Levels, cost: float) -> None:
        """Learn the cost of a corner from a sample near it, unless its own is known."""
        if self._costs.get(levels, inf) == inf:
            self._costs[levels] = cost

    @property
    def is_done(self) -> bool:
        """Whether all corners have been tried."""
        return len(self._costs) >= 1 << self.groups


def _flipped(levels: Levels, group: int) -> Levels:
    return (*levels[:group], 1 - levels[group], *levels[group + 1 :])
