"""A Gaussian process with a Matern-5/2 kernel on the unit box, with numpy and scipy only."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from falsifier.engines.layout import Array, learnable

# Limits of length scales in the unit box: far beyond them rounding makes the covariance indefinite.
_SHORTEST, _LONGEST = 1e-3, 1e3


def _correlation(x: Array, z: Array) -> Array:
    """Return the Matern-5/2 correlations of the rows of x, (n, d), with those of z, (m, d), shape (n, m).

    Both are in units of the length scales.
    """
    squared = (x**2).sum(1)[:, None] + (z**2).sum(1)[None] - 2.0 * x @ z.T
    d = np.sqrt(5.0) * np.sqrt(np.maximum(squared, 0.0))
    return np.asarray((1.0 + d + d * d / 3.0) * np.exp(-d))


@dataclass(frozen=True, slots=True, eq=False)
class GaussianProcess:
    """A process of zero mean and unit variance, conditioned on data.

    Attributes:
        points: points of the data, shape (n, d).
        lengths: length scale of each coordinate, shape (d,).
        factor: lower Cholesky factor of the covariance, shape (n, n).
        weights: covariance^-1 targets, shape (n,).
        evidence: log marginal likelihood, up to a constant.
    """

    points: Array
    lengths: Array
    factor: Array
    weights: Array
    evidence: float

    @classmethod
    def fit(cls, points: Array, targets: Array, lengths: Array, *, noise: float) -> "GaussianProcess":
        """Condition on targets, shape (n,), observed at points, shape (n, d), with this noise variance."""
        scaled = points / lengths
        covariance = _correlation(scaled, scaled) + noise * np.eye(len(points))
        factor = np.tril(cho_factor(covariance, lower=True)[0])
        weights = cho_solve((factor, True), targets)
        evidence = -0.5 * float(targets @ weights) - float(np.log(np.diag(factor)).sum())
        return cls(points, lengths, factor, weights, evidence)

    def predict(self, points: Array) -> tuple[Array, Array]:
        """Return mean and standard deviation, shape (m,) each, at points, shape (m, d)."""
        cross = _correlation(points / self.lengths, self.points / self.lengths)
        explained = solve_triangular(self.factor, cross.T, lower=True)
        variance = 1.0 - (explained**2).sum(axis=0)
        return cross @ self.weights, np.sqrt(np.maximum(variance, 1e-12))


def fit_lengths(
    points: Array, targets: Array, start: Array, rng: np.random.Generator, *, noise: float
) -> GaussianProcess:
    """Fit with the most likely of several length scales near ``start``, scaled jointly and individually."""
    tried = [np.clip(start * factor, _SHORTEST, _LONGEST) for factor in (1.0, 0.5, 0.8, 1.25, 2.0)]
    tried += [np.clip(start * np.exp(0.4 * rng.standard_normal(len(start))), 0.1, 20.0) for _ in range(12)]
    processes = [GaussianProcess.fit(points, targets, lengths, noise=noise) for lengths in tried]
    return max(processes, key=lambda process: process.evidence)


def standardised(costs: Array) -> Array:
    """Return costs as targets of a process: half their z-scores plus half the normal scores of their ranks.

    Because of the ranks, one very large cost cannot hide the differences among the small ones.
    """
    from scipy.special import ndtri

    costs = learnable(costs)
    count = len(costs)
    ranks = np.argsort(np.argsort(costs, kind="stable"), kind="stable") / max(count - 1, 1)
    scores = (costs - costs.mean()) / (costs.std() + 1e-12)
    return np.asarray(0.5 * scores + 0.5 * ndtri(0.02 + 0.96 * ranks))
