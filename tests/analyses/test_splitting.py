from collections.abc import Callable
from math import inf, log, sqrt

import numpy as np
import pytest

from falsifier.analyses.splitting import Cost, Point, least_budget, split


def corner(probability: float) -> float:
    """Distance a of the largest sum of two uniform numbers: P(sum > 2 - a) = a^2 / 2."""
    return sqrt(2 * probability)


def costs(probability: float) -> Callable[[Point], float]:
    distance = corner(probability)
    return lambda point: 2.0 - float(np.sum(point)) - distance


def test_intervals_of_small_probabilities_hold_about_as_often_as_stated() -> None:
    """bench/assurance.md has 200 repetitions for each of several systems."""
    truth, held, estimates = 1e-4, 0, []
    for seed in range(12):
        found = split(costs(truth), 2, budget=least_budget(), seed=seed, confidence=0.95)
        assert found.probability is not None and found.simulations <= least_budget()
        held += found.low <= truth <= found.high
        estimates.append(log(found.probability / truth))
    assert held >= 10
    assert abs(float(np.mean(estimates))) < 0.5


def test_a_larger_budget_narrows_the_interval() -> None:
    narrow, wide = (split(costs(1e-2), 2, budget=n * least_budget(), seed=1, confidence=0.95) for n in (5, 1))
    assert narrow.points > wide.points
    assert narrow.high / narrow.low < wide.high / wide.low


@pytest.mark.parametrize("cost", [lambda point: 0.5 + float(point[0]), lambda point: 1.0])
def test_what_ends_before_a_violation_gives_no_estimate(cost: Cost) -> None:
    found = split(cost, 2, budget=least_budget(), seed=1, confidence=0.95)
    assert (found.probability, found.low, found.high) == (None, 0.0, 1.0)


def test_violations_beside_the_slope_are_not_called_improbable() -> None:
    """A slope leads to no violation; a narrow band of probability 1e-3 that it passes by violates."""

    def cost(point: Point) -> float:
        return -1.0 if 0.37 <= point[0] < 0.371 else 2.0 - float(point[1])

    found = [split(cost, 2, budget=least_budget(), seed=s, confidence=0.95) for s in range(10)]
    assert all(s.low <= 1e-3 <= s.high for s in found)


def test_unknown_costs_are_above_all_others() -> None:
    def half_unknown(point: Point) -> float:
        return inf if point[0] < 0.5 else float(point[0]) - 0.9

    found = [split(half_unknown, 2, budget=least_budget(), seed=s, confidence=0.95) for s in range(10)]
    assert sum(s.low <= 0.4 <= s.high for s in found) >= 8


def test_the_seed_decides_everything() -> None:
    one, again, other = (
        split(costs(1e-2), 2, budget=least_budget(), seed=s, confidence=0.95) for s in (1, 1, 2)
    )
    assert one == again
    assert one.probability != pytest.approx(other.probability)
