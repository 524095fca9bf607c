"""Simulated annealing: scipy's dual annealing behind ``ask`` and ``tell``.

scipy calls the function that it minimises. To invert the control, dual annealing runs in a separate thread,
and its function passes each point to the engine and waits for the cost. The two threads alternate, so the
result does not depend on timing.
"""

import weakref
from queue import SimpleQueue
from threading import Thread

import numpy as np
from scipy.optimize import dual_annealing

from falsifier.engines.box import BoxEngine, Proposal, Vector
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
        self._walk = _Walk(self.box.dimension, seed)
        self._awaited: Vector | None = None
        self._worst = 0.0
        weakref.finalize(self, self._walk.stop)

    def _propose(self, rng: np.random.Generator) -> Proposal:
        if self._awaited is not None:
            return Proposal(rng.random(self.box.dimension), "uniform random, while annealing waits")
        self._awaited = self._walk.next_point()
        return Proposal(self._awaited, "a step of simulated annealing")

    def _learn(self, point: Vector, cost: float | None) -> None:
        if cost is not None:
            self._worst = max(self._worst, cost)
        # A failed simulation counts as the worst cost so far: annealing needs a number for every point.
        if self._awaited is not None and self._is_same(point, self._awaited):
            self._awaited = None
            self._walk.answer(self._worst if cost is None else cost)


class _Walk:
    """The annealing thread and the two queues between it and the engine."""

    def __init__(self, dimension: int, seed: int) -> None:
        self._points: SimpleQueue[Vector] = SimpleQueue()
        self._costs: SimpleQueue[float | None] = SimpleQueue()
        thread = Thread(target=self._run, args=(dimension, seed), name="annealing", daemon=True)
        thread.start()

    def next_point(self) -> Vector:
        """Return the point whose cost annealing waits for."""
        return self._points.get()

    def answer(self, cost: float) -> None:
        """Let annealing continue with this cost."""
        self._costs.put(cost)

    def stop(self) -> None:
        """End the thread."""
        self._costs.put(None)

    def _run(self, dimension: int, seed: int) -> None:
        try:
            while True:
                dual_annealing(
                    self._cost,
                    [(0.0, 1.0)] * dimension,
                    maxiter=_NEVER,
                    maxfun=_NEVER,
                    seed=seed,
                    no_local_search=True,
                )
                seed += 1
        except _Stopped:
            return

    def _cost(self, point: Vector) -> float:
        self._points.put(np.array(point))
        cost = self._costs.get()
        if cost is None:
            raise _Stopped
        return cost


class _Stopped(Exception):
    """The engine has been deleted."""
