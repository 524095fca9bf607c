"""Where simulations fail, learned from those that did: solvers diverge, models leave their tables."""

from dataclasses import dataclass, field

import numpy as np

from falsifier.engines.layout import Array, Layout, TimeGrid

# Log odds of a failure before anything is known, and the strength of that belief and of small weights.
_PRIOR, _RIDGE = -1.0, 0.1
_NEWTON_STEPS = 20


@dataclass
class Feasibility:
    """Logistic regression of failures on the lowest, mean and highest value of each input and parameter.

    Linear in these and in the squares of the extremes, because few failures must do: it generalises from two
    of them, and an input that does not matter does not disturb it.
    """

    layout: Layout
    grid: TimeGrid
    _features: list[Array] = field(default_factory=list)
    _failed: list[bool] = field(default_factory=list)
    _weights: Array | None = None

    @property
    def has_failures(self) -> bool:
        """Whether any simulation has failed so far; if none has, nothing is risky."""
        return any(self._failed)

    def add(self, point: Array, *, failed: bool) -> None:
        """Add the outcome of one simulation."""
        self._features.append(self._summary(point[None])[0])
        self._failed.append(failed)
        self._weights = None

    def risk(self, points: Array) -> Array:
        """Return the probability that the simulation of each point fails, shape (m,)."""
        if not self.has_failures:
            return np.zeros(len(points))
        if self._weights is None:
            self._weights = _fitted(np.array(self._features), np.array(self._failed, dtype=np.float64))
        return _logistic(self._summary(points) @ self._weights + _PRIOR)

    def excess(self, points: Array) -> Array:
        """Return how far the risk is above an even chance, from 0 to 1, shape (m,).

        Below that, only what is promising counts: violations are often close to where simulations fail.
        """
        return np.asarray(np.maximum(2.0 * self.risk(points) - 1.0, 0.0))

    def _summary(self, points: Array) -> Array:
        """Return the features of points, from -1 to 1, with a constant, shape (m, 5 groups + 1)."""
        inputs = 2.0 * self.layout.inputs(points, self.grid) - 1.0
        low, mean, high = inputs.min(axis=1), inputs.mean(axis=1), inputs.max(axis=1)
        return np.concatenate([low, mean, high, low**2, high**2, np.ones((len(points), 1))], axis=1)


def _fitted(features: Array, failed: Array) -> Array:
    """Return the most probable weights, by Newton's method; the penalty makes the maximum unique."""
    weights = np.zeros(features.shape[1])
    for _ in range(_NEWTON_STEPS):
        chance = _logistic(features @ weights + _PRIOR)
        gradient = features.T @ (chance - failed) + _RIDGE * weights
        curvature = (features.T * (chance * (1.0 - chance))) @ features + _RIDGE * np.eye(len(weights))
        step = np.linalg.solve(curvature, gradient)
        weights -= step
        if np.abs(step).max() < 1e-6:
            break
    return weights


def _logistic(x: Array) -> Array:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(x, -30.0, 30.0))))
