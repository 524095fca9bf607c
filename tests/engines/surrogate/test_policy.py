"""Whose turn it is."""

import numpy as np
import pytest

from falsifier.engines.surrogate.policy import Policy, worth
from falsifier.evaluation.levels import Levels
from tests.engines.surrogate.support import SETTINGS


def told(*robustness: float) -> tuple[Levels, list[float]]:
    levels = Levels()
    return levels, [worth(levels, r) for r in robustness]


def test_steps_down_count_by_how_far_they_go() -> None:
    _, brought = told(4.0, 3.0, 1.5, 1.5, 3.0, 2.0, -1.0)
    assert brought == [0.0, 0.625, 0.75, 0.0, 0.0, 0.25, 1.0]


def shares(policy: Policy, arms: list[str], **reserved: float) -> dict[str, float]:
    rng = np.random.default_rng(0)
    drawn = [policy.choose(arms, reserved, rng) for _ in range(2000)]
    return {arm: drawn.count(arm) / 2000 for arm in arms}


def test_an_arm_that_brings_more_has_more_turns_and_a_simple_one_keeps_its_share() -> None:
    policy = Policy({"a": 0.3, "b": 0.3, "simple": 0.1}, SETTINGS)
    for _ in range(10):
        policy.learn("a", 0.5, is_new=False)
        policy.learn("b", 0.0, is_new=False)
        policy.learn("someone else", 1.0, is_new=True)
    arms = ["a", "b", "simple"]
    without, kept = shares(policy, arms), shares(policy, arms, simple=0.1, absent=0.5)
    assert without["a"] > 0.9 and without["simple"] < 0.05
    assert kept["simple"] == pytest.approx(0.1, abs=0.03)


def test_on_a_plateau_ratings_fall_until_all_are_alike_and_new_marks_raise_one() -> None:
    policy = Policy({"a": 0.8, "b": 0.1}, SETTINGS)
    for _ in range(40):
        policy.learn("a", 0.0, is_new=False)
        policy.learn("b", 0.0, is_new=False)
    assert shares(policy, ["a", "b"])["a"] < 0.8
    policy.learn("b", 0.0, is_new=True)
    assert shares(policy, ["a", "b"])["b"] > 0.6
