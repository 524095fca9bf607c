"""Figures of signals over time, independent of any requirement."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from falsifier.core.trajectory import Trajectory
from falsifier.views.plotting.axes import caption, figure_of, own_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOUR = "#1f5fa8"


def plot_trajectory(trajectory: Trajectory, names: Sequence[str] | None = None) -> "Figure":
    """Plot signals over time, one small panel per signal.

    Args:
        trajectory: the simulation.
        names: names of the signals; None: all.
    """
    from matplotlib.figure import Figure

    names = trajectory.names if names is None else names
    figure = Figure(figsize=(8, 0.6 + 1.1 * len(names)), layout="constrained")
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for ax, name in zip(axes, names, strict=True):
        plot_signal(trajectory, name, ax)
        ax.set_xlabel("")
    axes[-1].set_xlabel("time [s]")
    return figure


def plot_signal(trajectory: Trajectory, name: str, ax: "Axes | None" = None, *, label: str = "") -> "Figure":
    """Plot one signal over time.

    Args:
        trajectory: the simulation.
        name: name of the signal.
        ax: where to draw; None: a new figure.
        label: label of the line in a legend; if given, each line gets its own colour.
    """
    ax = ax if ax is not None else own_axes(8, 2.5)
    colour = None if label else _COLOUR
    ax.plot(trajectory.times, trajectory[name], linewidth=1.2, label=caption(label) or None, color=colour)
    unit = trajectory.units.get(name, "")
    ax.set(xlabel="time [s]", ylabel=caption(f"{name} [{unit}]" if unit else name))
    return figure_of(ax)
