import numpy as np
import pytest
from scipy.stats import binom

from falsifier.search.assurance.bounds import interval, lower_bound, upper_bound


@pytest.mark.parametrize(("happened", "trials"), [(0, 10), (3, 100), (99, 100)])
def test_at_the_upper_bound_so_few_are_just_as_improbable_as_stated(happened: int, trials: int) -> None:
    assert binom.cdf(happened, trials, upper_bound(happened, trials, 0.95)) == pytest.approx(0.05)


def test_at_the_lower_bound_so_many_are_just_as_improbable_as_stated() -> None:
    assert binom.sf(3 - 1, 100, lower_bound(3, 100, 0.9)) == pytest.approx(0.1)


def test_none_gives_the_rule_of_three_and_all_give_no_bound() -> None:
    assert upper_bound(0, 1000, 0.95) == pytest.approx(3 / 1000, rel=5e-3)
    assert (lower_bound(0, 1000, 0.95), upper_bound(7, 7, 0.95)) == (0.0, 1.0)


@pytest.mark.parametrize("probability", [1e-4, 1e-2, 0.3])
def test_bounds_hold_at_least_as_often_as_stated(probability: float) -> None:
    """Exactly, over all outcomes, with the probability of each."""
    trials = 300
    outcomes = np.arange(trials + 1)
    weights = binom.pmf(outcomes, trials, probability)
    above = [upper_bound(int(k), trials, 0.95) >= probability for k in outcomes]
    within = [low <= probability <= high for low, high in (interval(int(k), trials, 0.95) for k in outcomes)]
    assert weights[above].sum() >= 0.95
    assert weights[within].sum() >= 0.95
