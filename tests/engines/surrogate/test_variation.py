import numpy as np

from falsifier.engines.surrogate.grid import Grid
from falsifier.engines.surrogate.layout import planning_layout
from falsifier.engines.surrogate.variation import mutations
from falsifier.testing import FREE, lag_problem


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
