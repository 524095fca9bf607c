"""Figures of one simulation."""

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.search.result import Result
from falsifier.views.panels import Panel, panels
from falsifier.views.plotting.axes import caption, figure_of, own_axes
from falsifier.views.plotting.trajectory import plot_trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_OUTPUT, _INPUT, _BOUND, _CRITICAL, _WINDOW = "#1f5fa8", "#2f7d4f", "#b3261e", "#b3261e", "#8a8a8a"
_PANEL_HEIGHT = 1.9


def plot(shown: Result | Confirmation | Trajectory) -> "Figure":
    """Plot a result, a counterexample or a trajectory.

    Raises:
        ValueError: for a result in which every simulation failed.
    """
    if isinstance(shown, Trajectory):
        return plot_trajectory(shown)
    evaluation = shown.shown if isinstance(shown, Result) else shown.evaluation
    if evaluation is None:
        raise ValueError("nothing to plot: every simulation failed")
    return plot_evaluation(shown.problem, evaluation)


def plot_evaluation(problem: Problem, evaluation: Evaluation) -> "Figure":
    """Plot one simulation: compared quantities with their bounds and windows, then inputs.

    Args:
        problem: the problem with the requirement and the search space.
        evaluation: an evaluation with its trajectory.

    Raises:
        ValueError: if the evaluation has no trajectory.
    """
    trajectory, verdict = evaluation.trajectory, evaluation.verdict
    if trajectory is None or verdict is None:
        raise ValueError("nothing to plot: the simulation failed, or its trajectory was not kept")
    from matplotlib.figure import Figure

    drawn = panels(
        problem.requirement.formula, trajectory, evaluation.candidate, problem.space.inputs, verdict
    )
    figure = Figure(figsize=(9, 1.0 + _PANEL_HEIGHT * len(drawn)), layout="constrained")
    axes = figure.subplots(len(drawn), 1, sharex=True, squeeze=False)[:, 0]
    for ax, panel in zip(axes, drawn, strict=True):
        plot_panel(ax, panel)
        ax.axvline(verdict.critical_time, color=_CRITICAL, linewidth=0.8, linestyle=":")
    axes[-1].set_xlabel("time [s]")
    parameters = "".join(f", {name} = {value:.6g}" for name, value in evaluation.candidate.parameters.items())
    decided = f"robustness {verdict.robustness:+.5g}, decided at t = {verdict.critical_time:.5g} s"
    figure.suptitle(f"{caption(problem.name)}: {decided}{caption(parameters)}", fontsize=11)
    return figure


def plot_requirement(
    problem: Problem, evaluation: Evaluation, ax: "Axes | None" = None, *, inset: float | None = None
) -> "Figure":
    """Plot the quantity that decided the verdict, with its bound, its window and the critical time.

    Args:
        problem: the problem with the requirement.
        evaluation: an evaluation with its trajectory.
        ax: where to draw; None: a new figure.
        inset: length in s of the time around the critical one that a second, enlarged plot inside shows.

    Raises:
        ValueError: if the evaluation has no trajectory.
    """
    trajectory, verdict = evaluation.trajectory, evaluation.verdict
    if trajectory is None or verdict is None:
        raise ValueError("nothing to plot: the simulation failed, or its trajectory was not kept")
    ax = ax if ax is not None else own_axes(8, 3)
    drawn = panels(problem.requirement.formula, trajectory, evaluation.candidate, (), verdict)
    decisive = next(panel for panel in drawn if panel.critical is not None)
    plot_panel(ax, decisive)
    if inset is not None:
        _plot_inset(ax, decisive, verdict.critical_time, inset)
    ax.axvline(verdict.critical_time, color=_CRITICAL, linewidth=0.8, linestyle=":")
    ax.set(
        xlabel="time [s]",
        title=f"robustness {verdict.robustness:+.5g}, decided at t = {verdict.critical_time:.5g} s",
    )
    return figure_of(ax)


def _plot_inset(ax: "Axes", panel: Panel, critical: float, length: float) -> None:
    """Draw the panel again, enlarged around the critical time, in the lower right corner."""
    inside = ax.inset_axes((0.62, 0.12, 0.35, 0.42))
    plot_panel(inside, panel)
    inside.set(xlim=(critical - length / 2, critical + length / 2), ylabel="")
    near = abs(panel.times - critical) <= length / 2
    values = [panel.values[near], *(b.values[near & (panel.times <= b.end)] for b in panel.bounds)]
    low, high = min(v.min() for v in values if v.size), max(v.max() for v in values if v.size)
    margin = 0.1 * (high - low) or 1.0
    inside.set_ylim(low - margin, high + margin)
    inside.tick_params(labelsize=7)
    ax.indicate_inset_zoom(inside)


def plot_panel(ax: "Axes", panel: Panel) -> None:
    """Draw a quantity with its bounds, windows and critical point, or an input with its control points."""
    is_input = panel.limits is not None
    color = _INPUT if is_input else _OUTPUT
    style = "steps-post" if panel.steps else "default"
    ax.plot(panel.times, panel.values, color=color, linewidth=1.2, drawstyle=style)
    for bound in panel.bounds:
        within = (panel.times >= bound.start) & (panel.times <= bound.end)
        ax.plot(panel.times[within], bound.values[within], color=_BOUND, linewidth=1.2, linestyle="--")
        ax.axvspan(bound.start, bound.end, color=_WINDOW, alpha=0.08, linewidth=0)
    if panel.critical is not None:
        k = abs(panel.times - panel.critical).argmin()
        ax.plot(panel.times[k], panel.values[k], "o", color=_CRITICAL, markersize=5)
    if panel.points:
        ax.plot(*zip(*panel.points, strict=True), "o", color=_INPUT, markersize=3.5)
    if panel.limits is not None:
        low, high = panel.limits
        margin = 0.06 * (high - low)
        ax.set_ylim(low - margin, high + margin)
        for limit in panel.limits:
            ax.axhline(limit, color=_WINDOW, linewidth=0.6, linestyle=":")
    ax.set_ylabel(caption(panel.title))


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure; the file extension determines the format."""
    figure.savefig(path, dpi=130)


def png(figure: "Figure", *, dpi: int) -> bytes:
    """Return a figure as the content of a PNG file."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()
