import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.engines.surrogate.coordinates import choose_coordinates
from falsifier.stl import parse


def test_outputs_that_are_only_compared_with_each_other_become_differences() -> None:
    times = np.linspace(0, 10, 11)
    rng = np.random.default_rng(0)
    outputs = ("y1", "y2", "y3", "z")
    trajectory = Trajectory(times, {name: rng.standard_normal(11) for name in outputs})
    relative = choose_coordinates(parse("G[0,9] (y2 - y1 <= 4)"), outputs, {}, trajectory)
    assert relative.families == ((0, 1, 2),)
    values = relative.of(trajectory)
    assert values[:, 0] == pytest.approx(trajectory["y2"] - trajectory["y1"])
    columns = relative.columns(values)
    assert columns["y3"] - columns["y1"] == pytest.approx(trajectory["y3"] - trajectory["y1"])
    assert columns["z"] == pytest.approx(trajectory["z"])
    absolute = choose_coordinates(parse("G[0,9] (y2 - y1 <= 4 and y3 > 0)"), outputs, {}, trajectory)
    assert absolute.families == ()
    assert absolute.columns(absolute.of(trajectory))["y1"] == pytest.approx(trajectory["y1"])
