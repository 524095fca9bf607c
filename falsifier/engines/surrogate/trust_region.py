"""A Gaussian process in a trust region, on the control points and parameters of the spec.

The region follows TuRBO (Eriksson et al., NeurIPS 2019): around the best point, it grows while steps succeed
and shrinks while they fail; when it is small, the search starts again elsewhere.
"""

import numpy as np

from falsifier.engines.box import BoxEngine, Proposal
from falsifier.engines.layout import Array
from falsifier.engines.optimisers.gaussian_process import fit_lengths, standardised
from falsifier.problem.problem import Problem

# First, longest and shortest side of the region, as shares of the ranges.
_FIRST_SIDE, _LONGEST, _SHORTEST = 0.8, 1.6, 0.02
# Successes in a row after which the side doubles.
_SUCCESSES = 3
# Points of the process, those nearest to the best one; candidates from which the next point is chosen.
_MOST_POINTS, _CANDIDATES = 80, 400
# Mean number of coordinates in which a candidate differs from the best point: all at once seldom helps.
_CHANGED = 8.0
# Of the changed coordinates, the share that is at a bound.
_AT_BOUND = 0.1
# Variance of the observation noise, relative to that of the standardised costs.
_NOISE = 1e-4


class TrustRegion(BoxEngine):
    """Proposes points near the best one where a draw of the process is lowest; learns from all points."""

    name = "region"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        super().__init__(problem, seed=seed)
        self._points: list[Array] = []
        self._costs: list[float] = []
        self._own: list[Array] = []
        self._restart(first=0)

    def _restart(self, *, first: int) -> None:
        self._first, self._side = first, _FIRST_SIDE
        self._successes = self._failures = 0

    def _propose(self, rng: np.random.Generator) -> Proposal:
        d = self.box.dimension
        costs = np.array(self._costs[self._first :])
        if len(costs) < min(d + 2, 12):
            drawn: Array = rng.random(d)
            why = "a new start of the trust region"
        else:
            drawn = self._step(np.array(self._points[self._first :]), costs, rng)
            why = "a step in a trust region"
        point = self.box.settled(drawn)
        self._own.append(point)
        return Proposal(point, why)

    def _step(self, points: Array, costs: Array, rng: np.random.Generator) -> Array:
        d = self.box.dimension
        best = points[int(np.argmin(costs))]
        near = np.argsort(np.abs(points - best).max(axis=1), kind="stable")[:_MOST_POINTS]
        process = fit_lengths(points[near], standardised(costs[near]), noise=_NOISE)
        # Coordinates of which the cost depends little get a longer side.
        weights = np.clip(process.lengths / np.exp(np.log(process.lengths).mean()), 0.25, 4.0)
        half = 0.5 * self._side * weights
        low, high = np.clip(best - half, 0.0, 1.0), np.clip(best + half, 0.0, 1.0)
        moved = rng.random((_CANDIDATES, d)) < min(1.0, _CHANGED / d)
        moved[np.arange(_CANDIDATES), rng.integers(0, d, _CANDIDATES)] = True
        levels = low + (high - low) * rng.random((_CANDIDATES, d))
        levels = np.where(
            rng.random((_CANDIDATES, d)) < _AT_BOUND, np.where(levels > best, high, low), levels
        )
        candidates = self.box.settled(np.where(moved, levels, best))
        candidates = candidates[np.abs(candidates[:, None] - points[near]).max(axis=2).min(axis=1) > 1e-6]
        if not len(candidates):
            return rng.random(d)
        mean, deviation = process.predict(candidates)
        return np.asarray(candidates[np.argmin(mean - np.abs(rng.standard_normal(len(mean))) * deviation)])

    def _learn(self, point: Array, cost: float | None) -> None:
        is_own = any(self._is_same(point, own) for own in self._own)
        best = min(self._costs[self._first :], default=np.inf)
        if cost is not None:
            self._points.append(point)
            self._costs.append(cost)
        if not is_own:
            return
        self._own = [own for own in self._own if not self._is_same(point, own)]
        if cost is not None and cost < best - 1e-9 * abs(best):
            self._successes, self._failures = self._successes + 1, 0
        else:
            self._successes, self._failures = 0, self._failures + 1
        if self._successes >= _SUCCESSES:
            self._side, self._successes = min(2.0 * self._side, _LONGEST), 0
        elif self._failures >= max(4, self.box.dimension // 2):
            self._side, self._failures = 0.5 * self._side, 0
            if self._side < _SHORTEST:
                self._restart(first=len(self._costs))
