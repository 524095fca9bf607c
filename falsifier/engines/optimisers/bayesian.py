"""Bayesian optimisation: a Gaussian process of the robustness, maximising the expected improvement."""

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_ndtr, ndtr

from falsifier.engines.box import Proposal
from falsifier.engines.layout import Array
from falsifier.engines.optimisers.gaussian_process import fit_lengths, standardised
from falsifier.engines.simple import Sobol
from falsifier.problem.problem import Problem

# Maximum number of points of the process, whose cost grows with their cube: half the best, half the latest.
_MAX_POINTS = 200
# Variance of the observation noise, relative to that of the standardised costs; keeps the covariance regular.
_NOISE = 1e-4
# Starts of the local optimisation, chosen from random samples.
_STARTS = 3
_SAMPLES = 512


class Bayesian(Sobol):
    """Sobol points first, then the maximum of the log expected improvement of a Gaussian process."""

    name = "bayesian"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        super().__init__(problem, seed=seed)
        self._start = min(20, 2 * self.box.dimension + 2)
        self._points: list[Array] = []
        self._costs: list[float] = []

    def _propose(self, rng: np.random.Generator) -> Proposal:
        if self._asked < self._start or len(self._costs) < 2:
            few = "a Sobol point: too few evaluations for a Gaussian process yet"
            return Proposal(super()._propose(rng).point, few)
        points, costs = self._kept()
        return self._most_promising(points, standardised(costs), rng)

    def _learn(self, point: Array, cost: float | None) -> None:
        if cost is not None:
            self._points.append(point)
            self._costs.append(cost)

    def _kept(self) -> tuple[Array, Array]:
        points, costs = np.array(self._points), np.array(self._costs)
        if len(costs) <= _MAX_POINTS:
            return points, costs
        order = np.argsort(costs, kind="stable")[: _MAX_POINTS // 2]
        latest = np.arange(len(costs) - _MAX_POINTS // 2, len(costs))
        keep = np.unique(np.concatenate([order, latest]))
        return points[keep], costs[keep]

    def _most_promising(self, points: Array, targets: Array, rng: np.random.Generator) -> Proposal:
        process = fit_lengths(points, targets, noise=_NOISE)
        best = float(targets.min())
        d = self.box.dimension
        incumbent = process.points[int(np.argmin(targets))]
        near = np.clip(incumbent + 0.1 * rng.standard_normal((_SAMPLES // 2, d)), 0.0, 1.0)
        samples = np.concatenate([rng.random((_SAMPLES // 2, d)), near])
        values = log_improvement(*process.predict(samples), best)
        step = 1e-4

        def loss_and_slope(x: Array) -> tuple[float, Array]:
            shifts = np.where(x > 0.5, -step, step)
            around = np.concatenate([x[None], x + np.diag(shifts)])
            loss = -log_improvement(*process.predict(around), best)
            return float(loss[0]), (loss[1:] - loss[0]) / shifts

        winner, value = samples[int(np.argmax(values))], float(values.max())
        for start in samples[np.argsort(-values, kind="stable")[:_STARTS]]:
            found = minimize(
                loss_and_slope,
                start,
                jac=True,
                method="L-BFGS-B",
                bounds=[(0, 1)] * d,
                options={"maxiter": 30},
            )
            if -found.fun > value:
                winner, value = np.asarray(found.x), -float(found.fun)
        return Proposal(winner, f"log expected improvement {value:.3g} of the scaled robustness")


def log_improvement(mean: Array, deviation: Array, best: float) -> Array:
    """Return the logarithm of the expected improvement below ``best``.

    It is finite even if the mean is so far above ``best`` that the expected improvement underflows to 0;
    without that, the optimiser would have no gradient there.
    """
    z = (best - mean) / deviation
    log_density = -0.5 * z * z - 0.5 * np.log(2 * np.pi)
    plain = np.exp(log_density) + z * ndtr(z)
    with np.errstate(divide="ignore", invalid="ignore"):
        # For z << 0, phi(z) + z Phi(z) suffers from cancellation and tends to phi(z) / z^2.
        ratio = 1.0 + z * np.exp(log_ndtr(z) - log_density)
        tail = log_density + np.where(z < -20.0, -2.0 * np.log(np.abs(z)), np.log(np.maximum(ratio, 1e-300)))
        inside = np.log(plain)
    return np.asarray(np.where(z < -3.0, tail, inside) + np.log(deviation))
