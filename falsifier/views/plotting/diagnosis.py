"""Figure of how a formula gets its value: nested time windows down to the critical time."""

from typing import TYPE_CHECKING

from falsifier.evaluation.evaluate import Evaluation, monitor_for
from falsifier.problem.problem import Problem
from falsifier.stl import Formula
from falsifier.stl.formula import Always, Eventually, Until
from falsifier.views.plotting.axes import figure_of
from falsifier.views.plotting.simulation import plot_requirement

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = ("#8a5a00", "#2f7d4f", "#6a3d9a", "#1f5fa8")
# Operators with a time window, as formulas write them.
_OPERATORS: dict[type[Formula], str] = {Always: "G", Eventually: "F", Until: "U"}
# Height of a window's bar and of its row, as a share of the axes.
_BAR, _ROW = 0.025, 0.11


def plot_diagnosis(problem: Problem, evaluation: Evaluation, ax: "Axes | None" = None) -> "Figure":
    """Plot the deciding quantity, and below it the window of each operator on the path to the critical time.

    Args:
        problem: the problem with the requirement.
        evaluation: an evaluation with its trajectory.
        ax: where to draw; None: a new figure.

    Raises:
        ValueError: if the evaluation has no trajectory.
    """
    from matplotlib.transforms import blended_transform_factory

    figure = plot_requirement(problem, evaluation, ax)
    ax = figure.axes[0] if ax is None else ax
    assert evaluation.trajectory is not None
    path = monitor_for(problem).diagnose(evaluation.trajectory).path
    windows = [step for step in path if step.window is not None]
    in_axes = blended_transform_factory(ax.transData, ax.transAxes)
    low, high = ax.get_ylim()
    room = _ROW * (len(windows) + 1)
    ax.set_ylim(low - room * (high - low) / (1 - room), high)
    for row, step in enumerate(windows):
        assert step.window is not None
        start, end = step.window
        y, colour = _ROW * (len(windows) - row), _COLOURS[row % len(_COLOURS)]
        ax.fill_between([start, end], y, y - _BAR, color=colour, transform=in_axes, linewidth=0, alpha=0.8)
        label = f"{_OPERATORS[type(step.formula)]} over [{start:.6g}, {end:.6g}] s"
        ax.text(start, y, label, color=colour, transform=in_axes, va="bottom", fontsize=8)
    return figure_of(ax)
