"""What engines are compared on: a bowl over the box of a small problem."""

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.engines import make_engine
from falsifier.problem.problem import Problem
from falsifier.testing import lag_problem, simulated

TARGET = np.array([1.2, -0.4, 0.3, -1.5, 0.7])


def bowl(problem: Problem, candidate: Candidate) -> float:
    return 1.0 + float(((problem.space.encode(candidate) - TARGET) ** 2).sum())


def best_of(name: str, *, simulations: int) -> float:
    problem = lag_problem()
    engine = make_engine(name, problem, seed=1)
    costs = []
    for _ in range(simulations):
        (candidate,) = engine.ask()
        cost = bowl(problem, candidate)
        costs.append(cost)
        engine.tell([simulated(problem, lambda y, cost=cost: cost)(candidate)])  # type: ignore[misc]
    return min(costs)


def need(engine: str) -> None:
    if engine == "botorch":
        pytest.importorskip("botorch", reason="it brings torch, several hundred MB")
