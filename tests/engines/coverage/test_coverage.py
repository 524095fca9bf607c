from functools import partial

import pytest

from falsifier.core.space import Freedom, ParameterRange
from falsifier.engines.coverage import Coverage
from falsifier.evaluation.evaluate import evaluate
from falsifier.record.run import falsify
from falsifier.testing import drive, lag_problem
from tests.engines.coverage.support import lock_problem, safe_problem
from tests.engines.support import NamedEngine

# Of uniform inputs one in 3600 opens the lock: a tenth of that is what the engine may use at most.
TENTH = 360


class TestContract(NamedEngine):
    engine = "coverage"


@pytest.mark.parametrize("free", [None, Freedom(100, 0.1)])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_sequence_that_robustness_does_not_show_is_found_step_by_step(
    free: Freedom | None, seed: int
) -> None:
    result = falsify(lock_problem(free=free), "coverage", seed=seed, budget=TENTH)
    assert result.falsified


@pytest.mark.parametrize("seed", range(4))
def test_values_in_narrow_bands_are_used_again_once_they_are_found(seed: int) -> None:
    assert falsify(safe_problem(), "coverage", seed=seed, budget=100).falsified


@pytest.mark.parametrize("points", [1, 3])
def test_nothing_is_simulated_twice(points: int) -> None:
    problem = lag_problem("G[0,10] (x <= 99)", points=points)
    asked = drive(Coverage(problem, seed=2), partial(evaluate, problem), rounds=40)
    assert len({c.key for c in asked}) == 40


def test_a_small_space_is_searched_as_a_whole() -> None:
    problem = lag_problem(
        "G[0,10] (x <= 99)", inputs=0, parameters=[ParameterRange("x0", 0, 9, kind="integer")]
    )
    asked = drive(Coverage(problem, seed=2), partial(evaluate, problem), rounds=14)
    assert len({c.key for c in asked[:10]}) == 10
    assert len(asked) == 14, "then it repeats"
