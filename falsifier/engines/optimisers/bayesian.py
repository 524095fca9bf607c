"""Bayesian optimisation: Gaussian processes in a trust region, one for each condition of the formula.

The region follows TuRBO (Eriksson et al., NeurIPS 2019): around the best point, it grows while steps succeed
and shrinks while they fail; when it is small, the search starts again elsewhere.
"""

import numpy as np

from falsifier.engines.box import BoxEngine, Proposal
from falsifier.engines.layout import Array
from falsifier.engines.optimisers.conditions import Conditions
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem

# First, longest and shortest side of the region, as shares of the ranges.
_FIRST_SIDE, _LONGEST, _SHORTEST = 0.8, 1.6, 0.02
# Successes in a row after which the side doubles.
_SUCCESSES = 3
# Points of the process, those nearest to the best one; candidates from which the next point is chosen.
_MOST_POINTS, _CANDIDATES = 80, 1000
# Mean number of coordinates in which a candidate differs from the best point: all at once seldom helps.
_CHANGED = 8.0
# Of the changed coordinates, the share that is at a bound.
_AT_BOUND = 0.1
# Variance of the observation noise, relative to that of a condition; distance in standard deviations from the
# mean at which a condition is cut: what is far off would hide the differences among the rest.
_NOISE, _FARTHEST = 1e-4, 5.0


class Bayesian(BoxEngine):
    """Proposes points near the best one where draws of the processes are lowest; learns from all points."""

    name = "bayesian"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        super().__init__(problem, seed=seed)
        self._conditions = Conditions(problem.requirement.formula)
        self._points: list[Array] = []
        self._values: list[Array] = []
        self._own: list[Array] = []
        self._restart(first=0)

    def _restart(self, *, first: int) -> None:
        self._first, self._side = first, _FIRST_SIDE
        self._successes = self._failures = 0

    def _propose(self, rng: np.random.Generator) -> Proposal:
        d = self.box.dimension
        if len(self._points) - self._first < min(d + 2, 12):
            drawn: Array = rng.random(d)
            why = "a new start of the trust region"
        else:
            drawn = self._step(np.array(self._points[self._first :]), self._scores(), rng)
            why = "a step in a trust region"
        point = self.box.settled(drawn)
        self._own.append(point)
        return Proposal(point, why)

    def _scores(self) -> Array:
        """Return what the conditions were since the last start, divided by their spread: (conditions, n)."""
        values = np.array(self._values[self._first :]).T
        spread = values.std(axis=1, keepdims=True)
        return np.asarray(values / np.where(spread > 0.0, spread, 1.0))

    def _step(self, points: Array, scores: Array, rng: np.random.Generator) -> Array:
        # Here, because they load scipy, which many short searches do without.
        from scipy.spatial.distance import cdist

        from falsifier.engines.optimisers.gaussian_process import fit_lengths

        d = self.box.dimension
        best = points[int(np.argmin(self._conditions.lowest(scores, scores)))]
        near = np.argsort(np.abs(points - best).max(axis=1), kind="stable")[:_MOST_POINTS]
        points, scores = points[near], scores[:, near]
        centre, spread = scores.mean(axis=1, keepdims=True), scores.std(axis=1, keepdims=True) + 1e-12
        targets = np.clip((scores - centre) / spread, -_FARTHEST, _FARTHEST)
        processes = [fit_lengths(points, row, noise=_NOISE) for row in targets]
        # Coordinates on which little depends get a longer side.
        logs = np.mean([np.log(process.lengths) for process in processes], axis=0)
        half = 0.5 * self._side * np.clip(np.exp(logs - logs.mean()), 0.25, 4.0)
        low, high = np.clip(best - half, 0.0, 1.0), np.clip(best + half, 0.0, 1.0)
        moved = rng.random((_CANDIDATES, d)) < min(1.0, _CHANGED / d)
        moved[np.arange(_CANDIDATES), rng.integers(0, d, _CANDIDATES)] = True
        levels = low + (high - low) * rng.random((_CANDIDATES, d))
        levels = np.where(
            rng.random((_CANDIDATES, d)) < _AT_BOUND, np.where(levels > best, high, low), levels
        )
        candidates = self.box.settled(np.where(moved, levels, best))
        candidates = candidates[cdist(candidates, points, "chebyshev").min(axis=1) > 1e-6]
        if not len(candidates):
            return rng.random(d)
        predicted = [process.predict(candidates) for process in processes]
        means, deviations = (np.array(rows) for rows in zip(*predicted, strict=True))
        margin = np.abs(rng.standard_normal(len(candidates))) * deviations
        bounds = (centre + spread * (means + side) for side in (-margin, margin))
        return np.asarray(candidates[np.argmin(self._conditions.lowest(*bounds))])

    def _learn(self, point: Array, evaluation: Evaluation) -> None:
        values, improved = self._conditions.values(evaluation), False
        if values is not None:
            self._points.append(point)
            self._values.append(values)
            scores = self._scores()
            *others, latest = self._conditions.lowest(scores, scores)
            improved = all(latest < other - 1e-9 * abs(other) for other in others)
        own = [own for own in self._own if not self._is_same(point, own)]
        if len(own) == len(self._own):
            return
        self._own = own
        if improved:
            self._successes, self._failures = self._successes + 1, 0
        else:
            self._successes, self._failures = 0, self._failures + 1
        if self._successes >= _SUCCESSES:
            self._side, self._successes = min(2.0 * self._side, _LONGEST), 0
        elif self._failures >= max(4, self.box.dimension // 2):
            self._side, self._failures = 0.5 * self._side, 0
            if self._side < _SHORTEST:
                self._restart(first=len(self._points))
