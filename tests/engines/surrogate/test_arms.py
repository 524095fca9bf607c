import numpy as np

from falsifier.engines.surrogate.arms import choose_arm, flatness, quality


def test_arms_are_judged_by_their_latest_ranks() -> None:
    arms = ["a", "a", "b", "b"]
    costs = [4.0, 3.0, 1.0, 2.0]
    assert quality("b", arms, costs, window=2) > 0.5 > quality("a", arms, costs, window=2)
    assert quality("c", arms, costs, window=2) == 0.5
    rng = np.random.default_rng(0)
    drawn = [choose_arm({"a": 0.1, "b": 0.9}, rng, least=0.1) for _ in range(400)]
    assert 0.05 < drawn.count("a") / 400 < 0.15


def test_costs_are_flat_if_most_are_equal() -> None:
    assert flatness([]) == 0.0
    assert flatness([0.5, 0.5, -0.5, 0.5]) == 0.75
    assert flatness([0.1, 0.2, 0.3, 0.4]) == 0.25
