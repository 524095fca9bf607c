"""Engines that learn nothing, or only which corner is best: the yardsticks of all others."""

from math import inf

import numpy as np

from falsifier.engines.box import BoxEngine, Proposal
from falsifier.engines.layout import Array
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem

# A corner: whether each input and parameter is constant at its highest value, 1, or its lowest one, 0.
Levels = tuple[int, ...]


class Uniform(BoxEngine):
    """Points drawn uniformly at random from the box."""

    name = "uniform"

    def _propose(self, rng: np.random.Generator) -> Proposal:
        return Proposal(rng.random(self.box.dimension), "uniform random")


class Corners(BoxEngine):
    """All corners of the inputs' and parameters' ranges, then uniform random points.

    The first corner is random. Each of the next ones flips one level of the best corner so far, that of the
    input flipped least often. If the effects of the inputs are additive, this reaches the best corner after
    one simulation per input; an input without effect costs one simulation instead of half of all corners.
    """

    name = "corners"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        super().__init__(problem, seed=seed)
        ranges = zip(self.box.space.ranges, self.box.groups, strict=True)
        self._groups = {r.name: group for r, group in ranges if r.low < r.high}
        self._flips = np.zeros(len(self._groups), dtype=int)
        self._costs: dict[Levels, float] = {}

    @property
    def is_done(self) -> bool:
        """Whether all corners have been tried."""
        return len(self._costs) >= 1 << len(self._groups)

    def hear(self, point: Array, cost: float) -> None:
        """Let a point near a corner stand for it, unless its own cost is known: it need not be simulated."""
        levels = self._levels(np.rint(point))
        if levels is not None and self._costs.get(levels, inf) == inf:
            self._costs[levels] = cost

    def _propose(self, rng: np.random.Generator) -> Proposal:
        levels = self._next(rng)
        if levels is None:
            return Proposal(rng.random(self.box.dimension), "uniform random: all corners were tried")
        self._costs[levels] = inf
        point = np.zeros(self.box.dimension)
        for indices, level in zip(self._groups.values(), levels, strict=True):
            point[indices] = level
        words = [f"{n} {'high' if level else 'low'}" for n, level in zip(self._groups, levels, strict=True)]
        return Proposal(point, f"constant extremes: {', '.join(words) or 'nothing varies'}")

    def _learn(self, point: Array, evaluation: Evaluation) -> None:
        levels = self._levels(point)
        if levels is not None:
            self._costs[levels] = inf if evaluation.robustness is None else evaluation.robustness

    def _next(self, rng: np.random.Generator) -> Levels | None:
        """Return the levels of the next corner; None if all were tried."""
        if not self._costs:
            return tuple(int(v) for v in rng.integers(0, 2, len(self._groups)))
        for base in sorted(self._costs, key=lambda levels: self._costs[levels]):
            for group in np.argsort(self._flips + rng.random(len(self._groups))):
                levels = (*base[:group], 1 - base[group], *base[group + 1 :])
                if levels not in self._costs:
                    self._flips[group] += 1
                    return levels
        return None

    def _levels(self, point: Array) -> Levels | None:
        """Return the levels of the corner at a point; None if it is none."""
        levels = []
        for indices in self._groups.values():
            value = point[indices[0]]
            if value not in (0.0, 1.0) or not (point[indices] == value).all():
                return None
            levels.append(int(value))
        return tuple(levels)
