import numpy as np
import pytest

from falsifier.engines.surrogate.grid import Grid, Trace, grid_inputs
from falsifier.engines.surrogate.layout import planning_layout
from falsifier.engines.surrogate.variation import random_points
from falsifier.testing import FREE, START, lag_problem
from tests.engines.surrogate.support import history_of


def test_grid_inputs_of_a_point_and_of_its_candidate_agree() -> None:
    problem = lag_problem(free=FREE, parameters=[START])
    grid = Grid.over(10.0, 10.0, cells=50, shortest=0.05)
    layout = planning_layout(problem.space, grid)
    (point,) = random_points(layout, np.random.default_rng(4), 1)
    candidate = layout.candidate(point, origin="t", rationale="t")
    assert layout.inputs(point[None], grid)[0] == pytest.approx(grid_inputs(problem.space, grid, candidate))


def test_traces_beyond_the_horizon_teach_too() -> None:
    history = history_of(lag_problem("G[0,2] (x <= 3)", free=FREE), simulations=1)
    trace: Trace = history.samples[0].trace
    assert trace.inputs.shape[0] > history.grid.cells


@pytest.mark.parametrize(
    ("horizon", "stop", "cells", "shortest", "expected"),
    [
        (10.0, 10.0, 50, 0.05, (0.2, 50, 50)),
        (2.0, 10.0, 50, 0.05, (0.05, 40, 200)),  # cells would be shorter than the shortest
        (2.0, 100.0, 10, 0.1, (0.2, 10, 200)),  # twenty horizons are enough
        (0.0, 10.0, 50, 0.1, (0.2, 50, 50)),  # a formula of one moment
        (30.0, 10.0, 50, 0.1, (0.2, 50, 50)),  # no longer than the simulation
        (0.1, 10.0, 50, 1.0, (0.1, 1, 20)),
    ],
)
def test_a_grid_divides_the_horizon_evenly(
    horizon: float, stop: float, cells: int, shortest: float, expected: tuple[float, int, int]
) -> None:
    grid = Grid.over(horizon, stop, cells=cells, shortest=shortest)
    assert grid.step == pytest.approx(expected[0])
    assert (grid.cells, grid.all_cells) == expected[1:]
    assert grid.middles == pytest.approx((np.arange(grid.cells) + 0.5) * grid.step)
