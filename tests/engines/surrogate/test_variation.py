import numpy as np

from falsifier.engines.layout import Array, Layout, TimeGrid, planning_layout
from falsifier.engines.surrogate.variation import (
    held_from,
    mutations,
    paced,
    random_points,
    stepping,
    switching,
)
from falsifier.testing import FREE, START, lag_problem


def test_changes_near_the_critical_time_leave_what_comes_later_alone() -> None:
    problem = lag_problem(free=FREE)
    grid = TimeGrid.over(10.0, 10.0, cells=100, shortest=0.05)
    layout = planning_layout(problem.space, grid)
    parents = np.full((1, 100), 0.5)
    rng = np.random.default_rng(0)

    def late_changes(critical: float | None) -> float:
        known = None if critical is None else np.array([critical])
        children = mutations(layout, rng, parents, 400, critical=known)
        return float(np.mean(children[:, 45:] != 0.5))

    assert late_changes(0.3) < 0.7 * late_changes(None)


def free_layout(cells: int = 100) -> Layout:
    problem = lag_problem(free=FREE, parameters=[START])
    return planning_layout(problem.space, TimeGrid.over(10.0, 10.0, cells=cells, shortest=0.05))


def pieces(points: Array) -> Array:
    """Number of pieces of the input in each row."""
    return np.asarray(1 + (np.diff(points[:, :-1], axis=1) != 0).sum(axis=1))


def test_random_points_have_few_or_many_pieces_at_bounds_or_anywhere() -> None:
    points = random_points(free_layout(), np.random.default_rng(0), 400)
    assert points.min() == 0.0 and points.max() == 1.0
    counts = pieces(points)
    assert (counts <= 2).mean() > 0.1 and (counts >= 20).mean() > 0.1
    at_bounds = np.isin(points[:, :-1], (0.0, 1.0)).all(axis=1)
    assert 0.4 < at_bounds.mean() < 0.8


def test_switching_inputs_stay_at_a_bound_for_the_dwell() -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        point = switching(free_layout(), rng, 2.0)
        assert set(point[:-1].tolist()) <= {0.0, 1.0}
        changes = np.flatnonzero(np.diff(point[:-1]))
        assert (np.diff(changes) >= 19).all(), "20 cells are 2 s"


def test_stepping_inputs_go_through_all_levels_once() -> None:
    point = stepping(free_layout(), np.random.default_rng(2), 10)[:-1]
    levels = point[::10]
    assert pieces(np.append(point, 0.0)[None]).tolist() == [10]
    assert sorted((10 * levels).astype(int)) == list(range(10))


def test_paced_inputs_change_together_after_pieces_of_all_lengths() -> None:
    problem = lag_problem(free=FREE, inputs=2, parameters=[START])
    layout = planning_layout(problem.space, TimeGrid.over(10.0, 10.0, cells=100, shortest=0.05))
    rng = np.random.default_rng(0)
    firsts, counts = [], []
    for _ in range(400):
        point = paced(layout, rng, 4, 1.0)
        first, second = (point[group] for group in layout.groups[:2])
        assert set(np.concatenate([first, second]).tolist()) <= {0.0, 1.0}
        changes = np.flatnonzero((np.diff(first) != 0) | (np.diff(second) != 0)) + 1
        firsts += changes[:1].tolist()
        counts.append(1 + len(changes))
    assert max(counts) == 4 and counts.count(1) > 60
    # A first piece of up to ten cells is about as likely as one of ten to a hundred.
    assert 0.35 < np.mean(np.array(firsts) <= 10) < 0.75


def test_an_end_is_constant_from_a_time_before_the_latest_on() -> None:
    layout = free_layout()
    rng = np.random.default_rng(0)
    points = random_points(layout, rng, 200)
    held = held_from(layout, rng, points, np.full(200, 3.0), 0.5)
    assert (held[:, 31:100] == held[:, 31:32]).all()
    assert (held[:, 100] == points[:, 100]).all(), "parameters stay"
    kept = (held[:, :31] == points[:, :31]).mean(axis=0)
    assert kept[0] > 0.9 > 0.6 > kept[25]
