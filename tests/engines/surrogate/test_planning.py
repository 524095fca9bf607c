import numpy as np

from falsifier.engines.layout import Array, TimeGrid, planning_layout
from falsifier.engines.surrogate import Settings
from falsifier.engines.surrogate.planning import is_seen, plan
from falsifier.testing import FREE, lag_problem


def test_a_plan_finds_the_best_point_that_has_not_been_simulated() -> None:
    problem = lag_problem(free=FREE)
    layout = planning_layout(problem.space, TimeGrid.over(10.0, 10.0, cells=20, shortest=0.05))
    target = (np.arange(20) < 7).astype(float)

    def distance(points: Array) -> Array:
        return np.asarray(np.abs(points - target).sum(axis=1))

    def planned(seen: Array) -> Array:
        return plan(
            distance,
            layout,
            elites=np.zeros((1, 20)),
            critical=np.ones(1),
            seen=seen,
            settings=Settings(),
            rng=np.random.default_rng(0),
        )

    best = planned(np.zeros((1, 20)))
    assert distance(best[None])[0] < 0.5
    other = planned(best[None])
    assert not is_seen(other, best[None]) and distance(other[None])[0] < 7.0
