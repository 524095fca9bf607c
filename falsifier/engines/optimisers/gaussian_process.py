"""A Gaussian process with a Matern-5/2 kernel on the unit box, with numpy and scipy only."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize

from falsifier.engines.layout import Array

# Limits of length scales in the unit box: far beyond them rounding makes the covariance indefinite.
_SHORTEST, _LONGEST = 1e-3, 1e3
# Usual length scale of one coordinate, standard deviation of its logarithm, and steps of the optimisation.
_USUAL, _SPREAD, _STEPS = 0.5, 1.5, 25


def _correlation(x: Array, z: Array) -> Array:
    """Return the Matern-5/2 correlations of the rows of x, (n, d), with those of z, (m, d), shape (n, m).

    Both are in units of the length scales.
    """
    squared = (x**2).sum(1)[:, None] + (z**2).sum(1)[None] - 2.0 * x @ z.T
    d = np.sqrt(5.0) * np.sqrt(np.maximum(squared, 0.0))
    return np.asarray((1.0 + d + d * d / 3.0) * np.exp(-d))


@dataclass(frozen=True, slots=True, eq=False)
class GaussianProcess:
    """A process of zero mean and unit variance, conditioned on data."""

    points: Array  # points of the data, shape (n, d)
    lengths: Array  # length scale of each coordinate, shape (d,)
    factor: Array  # lower Cholesky factor of the covariance, shape (n, n)
    weights: Array  # covariance^-1 targets, shape (n,)

    def predict(self, points: Array) -> tuple[Array, Array]:
        """Return mean and standard deviation, shape (m,) each, at points, shape (m, d)."""
        cross = _correlation(points / self.lengths, self.points / self.lengths)
        explained = solve_triangular(self.factor, cross.T, lower=True)
        return cross @ self.weights, np.sqrt(np.maximum(1.0 - (explained**2).sum(axis=0), 1e-12))


def fit_lengths(points: Array, targets: Array, *, noise: float) -> GaussianProcess:
    """Condition on targets, shape (n,), observed at points, shape (n, d), with this noise variance.

    The length scales are those that are most probable given the data.

    Before the data, their logarithms are normal; the centre grows with the square root of the number of
    coordinates, as distances in the unit box do (Hvarfner et al., ICML 2024).
    """
    count, dimension = points.shape
    squares = (points[:, None] - points) ** 2
    centre = np.full(dimension, np.log(_USUAL * np.sqrt(dimension)))

    def loss_and_slope(logs: Array) -> tuple[float, Array]:
        """Return the negative log of the posterior density, up to a constant, and its gradient."""
        inverse = np.exp(-2.0 * logs)
        d = np.sqrt(5.0 * np.maximum(squares @ inverse, 0.0))
        decay = np.exp(-d)
        factor = cho_factor((1.0 + d + d * d / 3.0) * decay + noise * np.eye(count), lower=True)
        inverted = cho_solve(factor, np.eye(count))
        weights, deviations = inverted @ targets, (logs - centre) / _SPREAD
        loss = 0.5 * (targets @ weights + deviations @ deviations) + np.log(np.diag(factor[0])).sum()
        inner = (inverted - np.outer(weights, weights)) * (1.0 + d) * decay * (5.0 / 6.0)
        return float(loss), np.einsum("ij,ijk->k", inner, squares) * inverse + deviations / _SPREAD

    limits = [(np.log(_SHORTEST), np.log(_LONGEST))] * dimension
    found = minimize(
        loss_and_slope, centre, jac=True, method="L-BFGS-B", bounds=limits, options={"maxiter": _STEPS}
    )
    lengths = np.exp(found.x)
    scaled = points / lengths
    factor = np.tril(cho_factor(_correlation(scaled, scaled) + noise * np.eye(count), lower=True)[0])
    return GaussianProcess(points, lengths, factor, cho_solve((factor, True), targets))
