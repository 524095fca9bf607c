import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.grid import Grid
from falsifier.engines.layout import planning_layout
from falsifier.engines.surrogate import Settings
from falsifier.engines.surrogate.planning import plan
from falsifier.testing import FREE, lag_problem


def test_a_plan_finds_the_best_point_and_prefers_simple_ones_that_are_nearly_as_good() -> None:
    problem = lag_problem(free=FREE)
    grid = Grid.over(10.0, 10.0, cells=20, shortest=0.05)
    layout = planning_layout(problem.space, grid)
    target = (np.arange(20) < 7).astype(float)

    def distance(points: Array) -> Array:
        return np.asarray(np.abs(points - target).sum(axis=1))

    def planned(snap: float) -> tuple[float, bool]:
        result = plan(
            distance,
            layout,
            elites=np.zeros((1, 20)),
            critical=np.ones(1),
            seen=np.zeros((1, 20)),
            settings=Settings(),
            snap=snap,
            rng=np.random.default_rng(0),
        )
        return result.cost, result.is_simple

    assert planned(0.0)[0] < 1.0
    # The constant 0 is seen already, so that the constant 1 is the simple one.
    assert planned(20.0) == (13.0, True)
