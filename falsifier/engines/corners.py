"""Constant extremes first: many requirements have their lowest robustness with inputs at their bounds."""

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import BoxEngine, Proposal, Vector
from falsifier.engines.corner_walk import CornerWalk, Levels
from falsifier.problem.problem import Problem


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
