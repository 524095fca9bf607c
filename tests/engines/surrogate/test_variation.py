import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.grid import Grid
from falsifier.engines.layout import Layout, planning_layout
from falsifier.engines.surrogate.variation import mutations, random_points, stepping, switching
from falsifier.testing import FREE, START, lag_problem


def test_changes_near_the_critical_time_leave_what_comes_later_alone() -> None:
    problem = lag_problem(free=FREE)
    grid = Grid.over(10.0, 10.0, cells=100, shortest=0.05)
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
    return planning_layout(problem.space, Grid.over(10.0, 10.0, cells=cells, shortest=0.05))


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


def test_children_stay_in_the_box_and_differ_from_their_parents() -> None:
    rng = np.random.default_rng(0)
    parents = random_points(free_layout(), rng, 5)
    children = mutations(free_layout(), rng, parents, 200)
    assert children.shape == (200, 101)
    assert children.min() >= 0.0 and children.max() <= 1.0
    same = (children[:, None] == parents[None]).all(axis=2).any(axis=1)
    assert same.mean() < 0.3


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
