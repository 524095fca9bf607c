"""Simulated annealing: scipy's dual annealing behind ``ask`` and ``tell``.

scipy calls the function that it minimises. To invert the control, dual annealing runs in a separate thread,
and its function passes each point to the engine and waits for the cost. The two threads alternate, so the
result does not depend on timing.
"""

import weakref
from contextlib import suppress
from queue import SimpleQueue
from threading import Thread

import numpy as np
from scipy.optimize import dual_annealing

from falsifier.engines.box import BoxEngine, Proposal
from falsifier.engines.layout import Array
from falsifier.problem.problem import Problem

# Limits of iterations and evaluations that are never reached: the loop's budget ends the search.
_NEVER = 10**9


class Annealing(BoxEngine):
    """Dual annealing without its local search, whose finite differences would cost d + 1 simulations each.

    Annealing is sequential: further candidates requested during a step are uniform random.
    """

    name = "annealing"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        super().__init__(problem, seed=seed)
        self._points: SimpleQueue[Array] = SimpleQueue()
        self._costs: SimpleQueue[float | None] = SimpleQueue()
        walk = self.box.dimension, seed, self._points, self._costs
        Thread(target=_walk, args=walk, name="annealing", daemon=True).start()
        self._awaited: Array | None = None
        self._worst = 0.0
        weakref.finalize(self, self._costs.put, None)

    def _propose(self, rng: np.random.Generator) -> Proposal:
        if self._awaited is not None:
            return Proposal(rng.random(self.box.dimension), "uniform random, while annealing waits")
        self._awaited = self._points.get()
        return Proposal(self._awaited, "a step of simulated annealing")

    def _learn(self, point: Array, cost: float | None) -> None:
        if cost is not None:
            self._worst = max(self._worst, cost)
        # A failed simulation counts as the worst cost so far: annealing needs a number for every point.
        if self._awaited is not None and self._is_same(point, self._awaited):
            self._awaited = None
            self._costs.put(self._worst if cost is None else cost)


def _walk(dimension: int, seed: int, points: SimpleQueue[Array], costs: SimpleQueue[float | None]) -> None:
    """Put the points of annealing, started again and again, until there is None in place of a cost."""

    def cost_of(point: Array) -> float:
        points.put(np.array(point))
        cost = costs.get()
        if cost is None:
            raise _Stopped
        return cost

    bounds = [(0.0, 1.0)] * dimension
    with suppress(_Stopped):
        while True:
            dual_annealing(cost_of, bounds, maxiter=_NEVER, maxfun=_NEVER, seed=seed, no_local_search=True)
            seed += 1


class _Stopped(Exception):
    """The engine has been deleted."""
