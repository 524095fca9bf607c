import pytest

from falsifier.core.space import Freedom
from falsifier.search.run import falsify
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
