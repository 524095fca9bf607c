import numpy as np

from falsifier.engines.corner_walk import CornerWalk


def test_additive_effects_are_found_within_one_simulation_per_input() -> None:
    weights = np.array([3.0, 0.0, -1.0, 2.0])
    best = float(np.minimum(weights, 0).sum())
    for seed in range(20):
        rng = np.random.default_rng(seed)
        walk = CornerWalk(4)
        costs = []
        for _ in range(5):
            levels = walk.next(rng)
            assert levels is not None
            costs.append(float(weights @ np.array(levels)))
            walk.learn(levels, costs[-1])
        assert min(costs) == best


def test_walk_ends_after_all_corners_and_knows_when_it_is_settled() -> None:
    rng = np.random.default_rng(0)
    walk = CornerWalk(2)
    seen = set()
    while (levels := walk.next(rng)) is not None:
        seen.add(levels)
        walk.learn(levels, float(sum(levels)))
    assert len(seen) == 4
    assert walk.settled


def test_a_failed_corner_is_tried_once_and_never_built_upon() -> None:
    rng = np.random.default_rng(3)
    walk = CornerWalk(3)
    assert not walk.settled
    first = walk.next(rng)
    assert first is not None
    walk.learn(first, None)
    second = walk.next(rng)
    assert second is not None
    walk.learn(second, 1.0)
    third = walk.next(rng)
    assert third not in (None, first, second)
    assert sum(a != b for a, b in zip(second, third or (), strict=True)) == 1, "the best one is built upon"


def test_a_corner_that_was_heard_of_is_built_upon_and_not_tried() -> None:
    walk = CornerWalk(2)
    walk.heard((0, 0), 1.0)
    rng = np.random.default_rng(0)
    first = walk.next(rng)
    assert first in ((0, 1), (1, 0))
    walk.learn(first, 2.0)
    walk.heard(first, 0.5)
    assert walk.next(rng) == tuple(1 - level for level in first)


def test_a_corner_that_is_pending_may_be_heard_of() -> None:
    walk = CornerWalk(2)
    rng = np.random.default_rng(0)
    first = walk.next(rng)
    assert first is not None
    walk.heard(first, -5.0)
    second = walk.next(rng)
    assert second is not None
    walk.learn(second, 3.0)
    third = walk.next(rng)
    assert third is not None
    assert sum(a != b for a, b in zip(first, third, strict=True)) == 1, "the best one is built upon"
