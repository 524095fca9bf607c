"""CMA-ES, the evolution strategy with covariance matrix adaptation, from the package ``cma``."""

from typing import TYPE_CHECKING

import numpy as np

from falsifier.engines.box import BoxEngine, Proposal
from falsifier.engines.layout import Array
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem

if TYPE_CHECKING:  # loading it takes longer than a short search
    from cma import CMAEvolutionStrategy

# Initial standard deviation as a share of the ranges: the authors recommend about a third.
_FIRST_STEP = 0.3
# Generations in a row that may consist of points whose costs are known; in a small space, all are in the end.
_GENERATIONS = 20


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
        self._strategy: CMAEvolutionStrategy | None = None
        self._generation: list[Array] = []
        self._costs: list[float | None] = []
        self._next = 0
        # Where different points have the same candidate, its cost is known from the first one.
        self._known: dict[bytes, float] = {}

    def _start(self) -> "CMAEvolutionStrategy":
        from cma import CMAEvolutionStrategy

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
        for _ in range(_GENERATIONS):
            strategy = self._begun()
            while self._next < len(self._generation):
                point = self._own(self._next)
                self._next += 1
                known = self._known.get(_key(point)) if self.box.has_gaps else None
                if known is None:
                    why = f"generation {strategy.countiter + 1} of the evolution strategy"
                    return Proposal(point, why)
                self._costs[self._next - 1] = known
            if not self._end():
                why = "uniform random, while a generation is simulated"
                return Proposal(rng.random(self.box.dimension), why)
        why = "uniform random: what the evolution strategy proposes was simulated"
        return Proposal(rng.random(self.box.dimension), why)

    def _learn(self, point: Array, evaluation: Evaluation) -> None:
        cost = evaluation.robustness
        if cost is not None:
            self._worst = max(self._worst, cost)
        # A failed simulation counts as the worst cost so far: the strategy needs a number for every point.
        known = self._worst if cost is None else cost
        if self.box.has_gaps:
            self._known[_key(point)] = known
        for i in range(self._next):
            if self._costs[i] is None and self._is_same(point, self._own(i)):
                self._costs[i] = known
                break
        self._end()

    def _own(self, i: int) -> Array:
        """Return a point of the generation, as its candidate has it."""
        return self.box.settled(self._generation[i][: self.box.dimension])

    def _begun(self) -> "CMAEvolutionStrategy":
        """Return the strategy, with a new generation if the last one has ended."""
        if self._strategy is None or (not self._generation and self._strategy.stop()):
            self._strategy = self._start()
        if not self._generation:
            self._generation = [np.asarray(x) for x in self._strategy.ask()]
            self._costs = [None] * len(self._generation)
            self._next = 0
        return self._strategy

    def _end(self) -> bool:
        """Tell the strategy if the costs of the whole generation are known; return whether they were."""
        told = [cost for cost in self._costs if cost is not None]
        if self._strategy is None or not self._generation or len(told) < len(self._generation):
            return False
        self._strategy.tell(self._generation, told)
        self._generation, self._next = [], 0
        return True


def _key(point: Array) -> bytes:
    return np.round(point, 6).tobytes()
