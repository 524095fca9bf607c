"""CMA-ES, the evolution strategy with covariance matrix adaptation, from the package ``cma``."""

import numpy as np
from cma import CMAEvolutionStrategy

from falsifier.engines.box import BoxEngine, Proposal, Vector
from falsifier.problem.problem import Problem

# Initial standard deviation as a share of the ranges: the authors recommend about a third.
_FIRST_STEP = 0.3


class CMA(BoxEngine):
    """CMA-ES from a random start, restarted after it has converged.

    A generation ends when all its points have been told; further candidates requested before that are uniform
    random.
    """

    name = "cma"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        super().__init__(problem, seed=seed)
        self._rng = np.random.default_rng([seed, 1])
        self._worst = 0.0
        self._strategy = self._start()
        self._generation: list[Vector] = []
        self._costs: list[float | None] = []
        self._next = 0

    def _start(self) -> CMAEvolutionStrategy:
        # The package requires two dimensions: a single coordinate is complemented by an unused second one.
        dimension = max(2, self.box.dimension)
        return CMAEvolutionStrategy(
            self._rng.random(dimension),
            _FIRST_STEP,
            {
                "bounds": [0, 1],
                "verbose": -9,
                "seed": np.nan,  # do not seed numpy's global generator
                "randn": lambda *shape: self._rng.standard_normal(shape),
            },
        )

    def _propose(self, rng: np.random.Generator) -> Proposal:
        if not self._generation:
            if self._strategy.stop():
                self._strategy = self._start()
            self._generation = [np.asarray(x) for x in self._strategy.ask()]
            self._costs = [None] * len(self._generation)
            self._next = 0
        if self._next == len(self._generation):
            return Proposal(rng.random(self.box.dimension), "uniform random, while a generation is simulated")
        point = self._generation[self._next][: self.box.dimension]
        self._next += 1
        return Proposal(point, f"generation {self._strategy.countiter + 1} of the evolution strategy")

    def _learn(self, point: Vector, cost: float | None) -> None:
        if cost is not None:
            self._worst = max(self._worst, cost)
        # A failed simulation counts as the worst cost so far: the strategy needs a number for every point.
        for i in range(self._next):
            own = self._generation[i][: self.box.dimension]
            if self._costs[i] is None and np.allclose(point, own, rtol=0, atol=1e-9):
                self._costs[i] = self._worst if cost is None else cost
                break
        told = [cost for cost in self._costs if cost is not None]
        if self._generation and len(told) == len(self._generation):
            self._strategy.tell(self._generation, told)
            self._generation, self._next = [], 0
