import pytest
from matplotlib.figure import Figure

from falsifier.errors import MonitorError
from falsifier.views.plotting import plot_signal, plot_trajectory
from tests.views.plotting.support import simulated, xs


def test_a_trajectory_has_a_panel_for_each_signal_with_its_unit() -> None:
    trajectory = simulated().trajectory
    assert trajectory is not None
    figure = plot_trajectory(trajectory)
    assert [ax.get_ylabel() for ax in figure.axes] == ["x [m]", "u [V]"]
    assert [ax.get_xlabel() for ax in figure.axes] == ["", "time [s]"]
    (ax,) = plot_trajectory(trajectory, ["u"]).axes
    assert (ax.get_ylabel(), ax.get_xlabel()) == ("u [V]", "time [s]")


def test_signals_with_labels_share_axes_in_colours_of_their_own() -> None:
    trajectory = simulated().trajectory
    assert trajectory is not None
    ax = Figure().subplots()
    for label in ("one", "other"):
        plot_signal(trajectory, "x", ax, label=label)
    assert [line.get_label() for line in ax.get_lines()] == ["one", "other"]
    assert len({line.get_color() for line in ax.get_lines()}) == 2
    assert xs(ax.get_lines()[0])[-1] == 10.0


def test_a_signal_that_is_not_there_is_named() -> None:
    trajectory = simulated().trajectory
    assert trajectory is not None
    with pytest.raises(MonitorError, match="'z'"):
        plot_signal(trajectory, "z")
