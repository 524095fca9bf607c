import numpy as np

from falsifier.engines.layout import Layout, TimeGrid, planning_layout
from falsifier.engines.surrogate.variation import (
    mutations,
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


def test_switching_inputs_stay_at_a_bound_for_the_dwell() -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        point = switching(free_layout(), rng, 2.0)
        assert set(point[:-1].tolist()) <= {0.0, 1.0}
        changes = np.flatnonzero(np.diff(point[:-1]))
        assert (np.diff(changes) >= 19).all(), "20 cells are 2 s"
