import numpy as np
import pytest

from falsifier.engines.grid import Grid
from falsifier.engines.layout import planning_layout
from falsifier.engines.surrogate.trace import Trace, grid_inputs
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
