from collections import deque

from falsifier.engines.known_first import KnownFirst
from falsifier.engines.protocol import Engine
from falsifier.engines.simple import Uniform
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.testing import EngineContract, lag_problem


class TestContract(EngineContract):
    def make(self, problem: Problem, seed: int) -> Engine:
        return KnownFirst(Uniform(problem, seed=seed), deque())


def test_known_candidates_come_first_and_once_among_engines_that_share_them() -> None:
    problem = lag_problem()
    candidates = Uniform(problem, seed=9).ask(3)
    known = deque(candidates)
    first, second = (KnownFirst(Uniform(problem, seed=s), known) for s in (1, 2))
    assert first.ask(2) == candidates[:2]
    assert second.ask(2) == candidates[2:]
    assert first.ask(1) == Uniform(problem, seed=1).ask(1)
    assert first.name == "uniform"


def test_the_other_engine_is_told() -> None:
    told: list[Evaluation] = []

    class Listening(Uniform):
        def tell(self, evaluations) -> None:  # type: ignore[no-untyped-def]
            told.extend(evaluations)

    problem = lag_problem()
    engine = KnownFirst(Listening(problem, seed=1), deque(Uniform(problem, seed=9).ask(1)))
    engine.tell([Evaluation(engine.ask()[0], "failed")])
    assert len(told) == 1
