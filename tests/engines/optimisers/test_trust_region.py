"""Where in the trust region the next point is looked for."""

import numpy as np

from falsifier.engines.layout import Array
from falsifier.engines.optimisers.trust_region import TrustRegion

REGION = TrustRegion(best=np.full(12, 0.5), low=np.full(12, 0.3), high=np.full(12, 0.9))
TARGET = np.linspace(0.3, 0.9, 12)


def far_from_target(points: Array, optimism: Array) -> Array:
    return np.asarray(np.abs(points - TARGET).sum(axis=1))


def as_it_is(points: Array) -> Array:
    return points


def test_variations_come_nearer_to_what_promises_most_than_random_points() -> None:
    judged: list[Array] = []

    def judge(points: Array, optimism: Array) -> Array:
        judged.append(far_from_target(points, optimism))
        return judged[-1]

    for seed in range(5):
        judged.clear()
        found = REGION.lowest(judge, as_it_is, np.random.default_rng(seed))
        assert found is not None
        distance = far_from_target(found[None], np.zeros(1))[0]
        assert distance == min(each.min() for each in judged), "the best of all that were judged"
        assert distance < 0.9 * judged[0].min()
        assert (found >= REGION.low).all() and (found <= REGION.high).all()


def test_variations_keep_the_optimism_of_their_origin() -> None:
    seen: list[set[float]] = []

    def judge(points: Array, optimism: Array) -> Array:
        seen.append(set(optimism.tolist()))
        return np.asarray(-optimism)

    assert REGION.lowest(judge, as_it_is, np.random.default_rng(0)) is not None
    first, *later = seen
    assert all(each < first and max(each) == max(first) for each in later)
    assert min(first) >= 0.0


def test_points_that_are_not_allowed_are_not_proposed() -> None:
    def left_half(points: Array, optimism: Array) -> Array:
        return np.where(points[:, 0] > 0.5, np.inf, far_from_target(points, optimism))

    def nothing(points: Array, optimism: Array) -> Array:
        return np.full(len(points), np.inf)

    found = REGION.lowest(left_half, as_it_is, np.random.default_rng(1))
    assert found is not None and found[0] <= 0.5
    assert REGION.lowest(nothing, as_it_is, np.random.default_rng(1)) is None


def test_points_are_those_of_candidates() -> None:
    found = REGION.lowest(far_from_target, lambda points: np.round(points, 1), np.random.default_rng(2))
    assert found is not None and (found == np.round(found, 1)).all()
