import numpy as np
import pytest

from falsifier.engines.grid import Grid
from falsifier.engines.layout import planning_layout, region_layouts
from falsifier.engines.surrogate.variation import mutations, random_points, stepping, switching
from falsifier.testing import FREE, START, lag_problem


def test_layouts_keep_to_the_allowed_parameterization() -> None:
    free, fixed = (lag_problem(free=free, inputs=2, parameters=[START]) for free in (FREE, None))
    grid = Grid.over(10.0, 10.0, cells=100, shortest=0.05)
    rng = np.random.default_rng(0)
    for problem in (free, fixed):
        for layout in (planning_layout(problem.space, grid), *region_layouts(problem.space, grid, (5, 8))):
            points = [*random_points(layout, rng, 5), switching(layout, rng, 0.7), stepping(layout, rng, 12)]
            points += list(mutations(layout, rng, np.array(points), 20, critical=np.full(7, 0.5)))
            for point in points:
                candidate = layout.candidate(point, origin="t", rationale="t")
                assert problem.space.admit(candidate).key == candidate.key
                assert layout.point(candidate) == pytest.approx(point, abs=1e-9)
    assert len(planning_layout(free.space, grid).codings[0].times) == 100
    assert len(planning_layout(fixed.space, grid).codings[0].times) == 4
    assert [len(r.codings[0].times) for r in region_layouts(free.space, grid, (5, 8))] == [5, 8]
    assert len(region_layouts(fixed.space, grid, (5, 8))) == 1


def test_a_point_near_a_constant_extreme_is_known_as_one() -> None:
    problem = lag_problem(free=FREE, inputs=2, parameters=[START])
    layout = planning_layout(problem.space, Grid.over(10.0, 10.0, cells=100, shortest=0.05))
    assert layout.nearest_extreme(layout.constant((0.05, 0.95, 1.0)), within=0.1) == (0, 1, 1)
    assert layout.nearest_extreme(layout.constant((0.05, 0.8, 1.0)), within=0.1) is None
    stepping_in_time = layout.constant((0.0, 0.0, 0.0))
    stepping_in_time[50:100] = 1.0
    assert layout.nearest_extreme(stepping_in_time, within=0.1) is None
