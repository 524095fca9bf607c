import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.surrogate.breeding import change, cross, draw

ENDS, IS_FINE = np.array([100, 108, 109]), np.array([True, False, False])


def drawn(count: int) -> Array:
    points = np.full((count, 109), np.nan)
    draw(points, ENDS, IS_FINE, np.random.default_rng(0))
    return points


def test_numbers_of_pieces_are_spread_over_all_orders_of_magnitude() -> None:
    points = drawn(2000)
    assert points.min() >= 0.0 and points.max() <= 1.0
    pieces = 1 + (np.diff(points[:, :100], axis=1) != 0).sum(axis=1)
    assert pieces.max() > 90
    # With every order equally likely, a third of the signals has up to 4 pieces; at bounds, some look equal.
    assert 0.28 < (pieces <= 4).mean() < 0.5
    starts = np.diff(points[:, :100], axis=1) != 0
    early, late = starts[:, :33].mean(), starts[:, 66:].mean()
    assert abs(early - late) < 0.1 * early


def test_control_points_and_parameters_are_at_bounds_or_anywhere() -> None:
    points = drawn(2000)
    for part in (points[:, 100:108], points[:, 108:]):
        at_bounds = np.isin(part, (0.0, 1.0)).all(axis=1)
        assert 0.4 < at_bounds.mean() < 0.6


def test_a_crossed_child_has_one_parent_up_to_a_time_and_the_other_after_it() -> None:
    parents = np.repeat([[0.0], [1.0]], 109, axis=1)
    children = np.zeros((200, 109))
    cross(children, parents, ENDS, 2, 1.0, np.random.default_rng(0))
    for signal, size in ((children[:, :100], 100), (children[:, 100:108], 8)):
        assert (np.diff(signal, axis=1) >= 0).all(), "never back to the first parent"
        assert len(set(signal.sum(axis=1).tolist())) > size // 4
    # Both inputs change at the same time.
    np.testing.assert_allclose(children[:, :100].mean(axis=1), children[:, 100:108].mean(axis=1), atol=0.13)
    assert 0.1 < children[:, 108].mean() < 0.4


def test_changes_of_a_parent_are_few_and_of_every_kind() -> None:
    parent = np.repeat([0.2, 0.7], [50, 59])
    children = np.repeat(parent[None], 600, axis=0)
    change(children, np.full(600, np.nan), ENDS, IS_FINE, np.random.default_rng(0))
    assert children.min() == 0.0 and children.max() == 1.0
    differs = children != parent
    by_group = np.stack([differs[:, :100], np.repeat(differs[:, 100:108], 13, axis=1)[:, :100]]).any(axis=2)
    assert (by_group.mean(axis=1) > 0.3).all() and differs.any(axis=1).mean() > 0.9
    held = children[:, :100]
    switches = np.diff(held, axis=1) != 0
    moved = (switches.sum(axis=1) == 1) & ~switches[:, 49] & np.isin(held, (0.2, 0.7)).all(axis=1)
    assert moved.mean() > 0.05, "the one switch was moved in time"
