import numpy as np
import pytest

from falsifier.engines.grid import Grid


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
