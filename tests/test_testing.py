"""What other people's tests are built of: that the contract catches engines which break it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.engines.protocol import Engine
from falsifier.errors import CandidateError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem
from falsifier.testing import BIAS, START, EngineContract, lag_problem
from tests.searches import Wrapped


class Refused(Exception):
    """Some engine's own complaint."""


class OutOfRange(Wrapped):
    def ask(self, n: int = 1) -> list[Candidate]:
        far = {n: replace(s, values=(9.0,) * len(s.values)) for n, s in self.inner.ask()[0].signals.items()}
        return [replace(c, signals=far) for c in self.inner.ask(n)]


class Unseeded(Wrapped):
    def __init__(self, problem: Problem, seed: int) -> None:
        super().__init__(problem, seed=int(np.random.default_rng().integers(2**31)))


class OneAtATime(Wrapped):
    def ask(self, n: int = 1) -> list[Candidate]:
        return self.inner.ask(1)


class Trusting(Wrapped):
    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        for evaluation in evaluations:
            if evaluation.verdict is None:
                raise Refused("no verdict")


class Stuck(Wrapped):
    def __init__(self, problem: Problem, seed: int) -> None:
        super().__init__(problem, seed)
        self.first = self.inner.ask()[0]

    def ask(self, n: int = 1) -> list[Candidate]:
        return [self.first] * n


def contract(engine: type[Wrapped]) -> EngineContract:
    class Contract(EngineContract):
        rounds = 4

        def make(self, problem: Problem, seed: int) -> Engine:
            return engine(problem, seed)

    return Contract()


TESTS = [name for name in vars(EngineContract) if name.startswith("test_")]


def test_an_engine_that_keeps_it_passes_all_of_it() -> None:
    for name in TESTS:
        getattr(contract(Wrapped), name)()


@pytest.mark.parametrize(
    ("engine", "test"),
    [
        (OutOfRange, "test_candidates_are_admitted_by_the_space"),
        (Unseeded, "test_deterministic_for_a_seed"),
        (Unseeded, "test_resumes_by_replay"),
        (OneAtATime, "test_asks_for_as_many_as_wanted"),
        (Trusting, "test_survives_failures"),
        (Stuck, "test_survives_a_plateau"),
    ],
)
def test_an_engine_that_breaks_it_fails(engine: type[Wrapped], test: str) -> None:
    with pytest.raises((AssertionError, CandidateError, Refused)):
        getattr(contract(engine), test)()


class TestLagProblem:
    def test_it_is_the_lag_that_it_says_it_is(self) -> None:
        problem = lag_problem(inputs=2, parameters=[START, BIAS])
        found = evaluate(problem, problem.space.decode([1.0] * 4 + [-0.5] * 4 + [0.25, 0.125]))
        assert found.trajectory is not None
        # x' = 0.5 + 0.125 - x from 0.25, by Euler with 0.1 s.
        expected = 0.625 + (0.25 - 0.625) * 0.9 ** np.arange(101)
        np.testing.assert_allclose(found.trajectory["x"], expected, atol=1e-12)
