import numpy as np

from falsifier.engines.surrogate.arms import choose_arm, flatness, has_lead, quality


def test_arms_are_judged_by_their_latest_ranks() -> None:
    arms = ["a", "a", "b", "b"]
    costs = [4.0, 3.0, 1.0, 2.0]
    assert (
        quality("b", arms, costs, window=2, power=1.0) > 0.5 > quality("a", arms, costs, window=2, power=1.0)
    )
    assert quality("c", arms, costs, window=2, power=1.0) == 0.5
    rng = np.random.default_rng(0)
    drawn = [choose_arm({"a": 0.1, "b": 0.9}, rng, least=0.1) for _ in range(400)]
    assert 0.05 < drawn.count("a") / 400 < 0.15


def test_an_arm_that_is_sometimes_the_best_is_worth_more_than_one_in_the_middle() -> None:
    arms = ["wild", "steady"] * 4
    costs = [0.0, 4.0, 9.0, 5.0, 8.0, 4.5, 7.0, 5.5]
    plain = {arm: quality(arm, arms, costs, window=4, power=1.0) for arm in ("wild", "steady")}
    sharp = {arm: quality(arm, arms, costs, window=4, power=8.0) for arm in ("wild", "steady")}
    assert plain["wild"] < plain["steady"] and sharp["wild"] > sharp["steady"]


def test_ranks_at_random_are_as_good_as_unknown_ones() -> None:
    costs = np.random.default_rng(0).permutation(400).astype(float).tolist()
    assert abs(quality("a", ["a"] * 400, costs, window=400, power=4.0) - 0.5) < 0.01


def test_costs_are_flat_if_most_are_equal() -> None:
    assert flatness([]) == 0.0
    assert flatness([0.5, 0.5, -0.5, 0.5]) == 0.75
    assert flatness([0.1, 0.2, 0.3, 0.4]) == 0.25


def test_a_cost_below_the_most_common_one_is_a_lead() -> None:
    assert has_lead([0.5, 0.5, 0.4, 0.5])
    assert not has_lead([0.5, 0.5, 0.6, 0.5])
    assert not has_lead([0.5])
