import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.views.sparkline import sparkline, trace_lines


def test_a_line_shows_the_course() -> None:
    ramp = np.linspace(0, 7, 801)
    assert sparkline(ramp, width=8)[0] < sparkline(ramp, width=8)[-1]
    assert sparkline(np.array([3.0, 3.0]), width=3) == "▁▁▁"


def test_each_signal_has_its_name_and_range() -> None:
    times = np.linspace(0, 1, 4)
    found = trace_lines(
        Trajectory(times, {"x": np.array([0.0, 0.0, 2.0, 2.0]), "speed": np.full(4, 3.0)}), width=4
    )
    assert found == ["x      ▁▁██  0 to 2", "speed  ▁▁▁▁  constant 3"]
