from matplotlib.figure import Figure

from falsifier.views.plotting import (
    plot_signal,
    plot_trajectory,
)
from tests.views.plotting.support import simulated


def test_a_trajectory_has_a_panel_for_each_signal_and_a_signal_its_unit() -> None:
    trajectory = simulated().trajectory
    assert trajectory is not None
    assert [ax.get_ylabel() for ax in plot_trajectory(trajectory).axes] == ["x [m]", "u [V]"]
    ax = Figure().subplots()
    plot_signal(trajectory, "x", ax, label="one")
    assert ax.get_lines()[0].get_label() == "one"
