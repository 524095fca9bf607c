"""The box around the best point in which the next point is looked for."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.layout import Array

# Random points, and mean number of coordinates in which one differs from the best point: all at once seldom
# helps.
_DRAWN, _CHANGED = 1000, 8.0
# Of the changed coordinates, the share that is at a bound.
_AT_BOUND = 0.1
# The most promising of random points is seldom near to what promises the most. So the first of them are
# varied in rounds: how many, how often each, by which share of the sides at first, and the factor per round.
_ROUNDS, _VARIED, _VARIATIONS, _STEP, _FINER = 3, 20, 25, 0.15, 0.5
# Mean number of coordinates that a variation moves, but at least this share of them; the share of all that
# return to those of the best point.
_MOVED, _LEAST_MOVED, _RETURNED = 3.0, 0.3, 0.05


@dataclass(frozen=True, slots=True, eq=False)
class TrustRegion:
    """The box; all are of shape (d,)."""

    best: Array  # the best point
    low: Array  # lower bounds
    high: Array  # upper bounds

    def lowest(
        self,
        judge: Callable[[Array, Array], Array],
        settled: Callable[[Array], Array],
        rng: np.random.Generator,
    ) -> Array | None:
        """Return the point at which what is promised is lowest; None if there is no point that is allowed.

        Args:
            judge: promises for points, shape (m, d), with an optimism for each, shape (m,), 0 or more: shape
                (m,), infinite for points that are not allowed.
            settled: moves points, shape (m, d), to the nearest ones that stand for a candidate.
            rng: what is drawn with.
        """
        points = settled(self._drawn(rng))
        optimism = np.abs(rng.standard_normal(len(points)))
        promises = judge(points, optimism)
        for finer in range(_ROUNDS):
            best = np.argsort(promises, kind="stable")[:_VARIED]
            varied = settled(
                self._varied(np.repeat(points[best], _VARIATIONS, axis=0), _STEP * _FINER**finer, rng)
            )
            same = np.repeat(optimism[best], _VARIATIONS)
            promises = np.concatenate([promises[best], judge(varied, same)])
            points, optimism = np.concatenate([points[best], varied]), np.concatenate([optimism[best], same])
        chosen = int(np.argmin(promises))
        return points[chosen] if np.isfinite(promises[chosen]) else None

    def _drawn(self, rng: np.random.Generator) -> Array:
        """Return random points, shape (m, d)."""
        shape = _DRAWN, len(self.best)
        moved = _some(rng, shape, min(1.0, _CHANGED / len(self.best)))
        levels = self.low + (self.high - self.low) * rng.random(shape)
        bounds = np.where(levels > self.best, self.high, self.low)
        return np.where(moved, np.where(rng.random(shape) < _AT_BOUND, bounds, levels), self.best)

    def _varied(self, points: Array, step: float, rng: np.random.Generator) -> Array:
        """Return points, shape (m, d), each with some coordinates moved by a share of the sides."""
        moved = _some(rng, points.shape, max(_LEAST_MOVED, min(1.0, _MOVED / len(self.best))))
        steps = step * (self.high - self.low) * rng.standard_normal(points.shape)
        varied = np.clip(points + np.where(moved, steps, 0.0), self.low, self.high)
        return np.where(rng.random(points.shape) < _RETURNED, self.best, varied)


def _some(rng: np.random.Generator, shape: tuple[int, ...], share: float) -> NDArray[np.bool_]:
    """Draw which coordinates change, each with this probability, and at least one of each point."""
    chosen = rng.random(shape) < share
    chosen[np.arange(len(chosen)), rng.integers(0, shape[1], len(chosen))] = True
    return chosen
