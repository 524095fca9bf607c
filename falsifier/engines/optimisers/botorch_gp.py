"""Bayesian optimisation with the Gaussian process, acquisition function and optimiser of ``botorch``."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from botorch import fit_gpytorch_mll
from botorch.acquisition import qLogExpectedImprovement
from botorch.exceptions.errors import ModelFittingError
from botorch.models import SingleTaskGP
from botorch.optim import optimize_acqf
from botorch.sampling import SobolQMCNormalSampler
from botorch.utils.sampling import manual_seed
from gpytorch.mlls import ExactMarginalLogLikelihood

from falsifier.engines.box import Proposal
from falsifier.engines.layout import Array
from falsifier.engines.optimisers.bayesian import GaussianProcessEngine
from falsifier.problem.problem import Problem

# Starts of the acquisition's optimisation, and the number of Sobol points from which they are chosen.
_RESTARTS = 4
_RAW_SAMPLES = 128
# Samples over which the expected improvement is averaged.
_DRAWS = 128


class BoTorch(GaussianProcessEngine):
    """Proposes the maximum of the log expected improvement, taking into account points being simulated."""

    name = "botorch"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        super().__init__(problem, seed=seed)
        self._pending: list[Array] = []

    def _propose(self, rng: np.random.Generator) -> Proposal:
        proposal = super()._propose(rng)
        self._pending.append(np.clip(proposal.point, 0.0, 1.0))
        return proposal

    def _learn(self, point: Array, cost: float | None) -> None:
        super()._learn(point, cost)
        self._pending = [p for p in self._pending if not self._is_same(point, p)]

    def _most_promising(self, points: Array, targets: Array, rng: np.random.Generator) -> Proposal:
        seed = int(rng.integers(2**31))
        with warnings.catch_warnings(), manual_seed(seed), _one_thread():
            warnings.simplefilter("ignore")  # about our scaling of the data and about repeated fits
            try:
                return self._maximum(points, targets, seed)
            except ModelFittingError:
                return Proposal(rng.random(self.box.dimension), "random: fitting the Gaussian process failed")

    def _maximum(self, points: Array, targets: Array, seed: int) -> Proposal:
        inputs, gains = torch.as_tensor(points), torch.as_tensor(-targets)[:, None]
        process = SingleTaskGP(inputs, gains)
        fit_gpytorch_mll(ExactMarginalLogLikelihood(process.likelihood, process))
        acquisition = qLogExpectedImprovement(
            process,
            best_f=gains.max(),
            sampler=SobolQMCNormalSampler(torch.Size([_DRAWS]), seed=seed),
            X_pending=torch.as_tensor(np.array(self._pending)) if self._pending else None,
        )
        bounds = torch.stack([torch.zeros_like(inputs[0]), torch.ones_like(inputs[0])])
        best, value = optimize_acqf(
            acquisition, bounds, q=1, num_restarts=_RESTARTS, raw_samples=_RAW_SAMPLES, options={"seed": seed}
        )
        return Proposal(
            best[0].numpy(), f"log expected improvement {float(value):.3g} of the scaled robustness"
        )


@contextmanager
def _one_thread() -> Iterator[None]:
    """Restrict torch to one thread: more do not help with small matrices, and slow down parallel runs."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
