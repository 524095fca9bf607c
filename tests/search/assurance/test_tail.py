import numpy as np
import pytest

from falsifier.search.assurance.tail import least_draws, tail

SEEDS = range(5)


def drawn(probability: float, seed: int, count: int = 400) -> list[float]:
    """Draw a robustness whose distances to a violation are exponential beyond their largest tenth."""
    far = -np.log(np.random.default_rng(seed).random(count))
    return [float(x) for x in -np.log(probability) - far]


@pytest.mark.parametrize("probability", [1e-2, 1e-3])
def test_the_known_probability_of_an_exponential_tail_is_in_the_interval(probability: float) -> None:
    found = [tail(drawn(probability, seed), confidence=0.95, seed=seed) for seed in SEEDS]
    within = [t is not None and t.low <= probability <= t.high for t in found]
    assert sum(within) >= len(SEEDS) - 1
    assert all(t is not None and t.points == 40 and t.low <= t.probability <= t.high for t in found)


def test_a_robustness_that_ends_before_a_violation_gives_zero_as_lower_end() -> None:
    values = (1.0 + np.random.default_rng(1).random(400)).tolist()
    found = tail(values, confidence=0.95, seed=1)
    assert found is not None
    assert found.low == 0.0 and found.probability < 1e-6 and found.high < 0.05


def test_a_distribution_of_two_kinds_is_a_poor_fit() -> None:
    rng = np.random.default_rng(2)
    values = np.concatenate([rng.normal(9.0, 0.1, 360), rng.normal(5.0, 0.01, 20), rng.normal(1.0, 0.01, 20)])
    found = tail(values.tolist(), confidence=0.95, seed=2)
    assert found is not None and found.is_poor


def test_too_few_draws_or_steps_give_no_estimate() -> None:
    assert tail(drawn(0.01, 1, least_draws() - 1), confidence=0.95, seed=1) is None
    assert tail([1.0, 2.0] * 200, confidence=0.95, seed=1) is None
