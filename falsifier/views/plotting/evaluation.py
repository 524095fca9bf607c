"""Figures of one simulation."""

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.search.parts import labels_of
from falsifier.search.result import Result
from falsifier.stl.verdict import Verdict
from falsifier.views.panels import Bound, Panel, panels
from falsifier.views.plotting.axes import caption, figure_of, own_axes, whole_ticks
from falsifier.views.plotting.trajectory import plot_trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_OUTPUT, _INPUT, _BOUND, _CRITICAL, _WINDOW = "#1f5fa8", "#2f7d4f", "#b3261e", "#b3261e", "#8a8a8a"
# Of a simulation that does not violate: not the colour of an alarm.
_NEAREST = "#b35900"
_PANEL_HEIGHT = 1.9
# A margin below this share of a panel's height is enlarged, with this share of the simulated time around it.
_HIDDEN, _ENLARGED = 0.02, 0.1
# There, the margin should be at least this share of what the quantity does, over at least so many samples.
_SEEN, _FEWEST_SAMPLES = 0.2, 5
# Corners for the enlarged part: left, bottom, width and height as shares of the panel.
_CORNERS = (
    (0.62, 0.12, 0.35, 0.42),
    (0.62, 0.52, 0.35, 0.42),
    (0.07, 0.52, 0.35, 0.42),
    (0.07, 0.12, 0.35, 0.42),
)
# Maximum number of bounds in a panel whose predicates are written beside them.
_LABELLED = 3
# Share of a panel's height above which a predicate is written below its line.
_TOP = 0.85


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
        problem.requirement.formula,
        trajectory,
        evaluation.candidate,
        problem.space.inputs,
        verdict,
        _labels(problem),
        problem.info.components,
    )
    colour = _decided_colour(verdict)
    figure = Figure(figsize=(9, 1.2 + _PANEL_HEIGHT * len(drawn)), layout="constrained")
    axes = figure.subplots(len(drawn), 1, sharex=True, squeeze=False)[:, 0]
    group = ""
    for ax, panel in zip(axes, drawn, strict=True):
        plot_panel(ax, panel, colour)
        if panel.component != group:
            group = panel.component
            ax.set_title(caption(group), loc="left", fontsize=9, weight="bold")
        if panel.critical is not None and _is_hidden(ax, verdict):
            _plot_inset(ax, panel, verdict, _enlarged(panel, verdict))
        ax.axvline(verdict.critical_time, color=colour, linewidth=0.8, linestyle=":")
    axes[-1].set_xlabel("time [s]")
    parameters = "".join(f", {name} = {value:.6g}" for name, value in evaluation.candidate.parameters.items())
    formula = caption(str(problem.requirement.formula))
    figure.suptitle(
        f"{caption(problem.name)}: {_decided(verdict)}{caption(parameters)}\n{formula}", fontsize=11
    )
    return figure


def _decided(verdict: Verdict) -> str:
    outcome = "violated" if verdict.robustness < 0 else "not violated"
    return f"{outcome}, robustness {verdict.robustness:+.5g}, decided at t = {verdict.critical_time:.5g} s"


def _decided_colour(verdict: Verdict) -> str:
    return _CRITICAL if verdict.robustness < 0 else _NEAREST


def _labels(problem: Problem) -> dict[str, dict[int, str]]:
    """Return the names of the numbers of each signal that is not real."""
    ranges = problem.space.inputs
    variables = (v for v in problem.info.variables if v.kind in ("integer", "boolean", "enumeration"))
    found = {v.name: labels_of(v.kind, v.literals.items()) for v in variables}
    return found | {r.name: labels_of(r.kind, r.items) for r in ranges if r.kind != "real"}


def _is_hidden(ax: "Axes", verdict: Verdict) -> bool:
    """Whether the margin is too small to be seen at the scale of a panel."""
    low, high = ax.get_ylim()
    return 0 < abs(verdict.robustness) < _HIDDEN * (high - low)


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
    drawn = panels(
        problem.requirement.formula, trajectory, evaluation.candidate, (), verdict, _labels(problem)
    )
    decisive = next(panel for panel in drawn if panel.critical is not None)
    plot_panel(ax, decisive, _decided_colour(verdict))
    if inset is not None:
        _plot_inset(ax, decisive, verdict, inset)
    ax.axvline(verdict.critical_time, color=_decided_colour(verdict), linewidth=0.8, linestyle=":")
    ax.set(xlabel="time [s]", title=_decided(verdict))
    return figure_of(ax)


def _enlarged(panel: Panel, verdict: Verdict) -> float:
    """Return how much time in s around the critical one to enlarge, so that the margin is seen."""
    length = _ENLARGED * float(panel.times[-1])
    while True:
        near = panel.values[abs(panel.times - verdict.critical_time) <= length / 4]
        if len(near) < _FEWEST_SAMPLES or abs(verdict.robustness) > _SEEN * float(np.ptp(near)):
            return length
        length /= 2


def _plot_inset(ax: "Axes", panel: Panel, verdict: Verdict, length: float) -> None:
    """Draw the panel again, enlarged around the critical time, in the emptiest corner."""
    critical = verdict.critical_time
    inside = ax.inset_axes(min(_CORNERS, key=lambda corner: _covered(ax, panel, corner)))
    plot_panel(inside, panel, _decided_colour(verdict))
    for text in inside.texts:
        text.set_visible(False)
    inside.set(xlim=(critical - length / 2, critical + length / 2), ylabel="")
    near = abs(panel.times - critical) <= length / 2
    values = [panel.values[near], *(b.values[near & (panel.times <= b.end)] for b in panel.bounds)]
    low, high = min(v.min() for v in values if v.size), max(v.max() for v in values if v.size)
    margin = 0.1 * (high - low) or 1.0
    inside.set_ylim(low - margin, high + margin)
    inside.tick_params(labelsize=7)
    ax.indicate_inset_zoom(inside)


def _covered(ax: "Axes", panel: Panel, corner: tuple[float, float, float, float]) -> int:
    """Return how many samples of a panel, and of its bounds, an inset in a corner would cover."""
    left, bottom, width, height = corner
    (first, last), (low, high) = ax.get_xlim(), ax.get_ylim()
    x = (panel.times - first) / (last - first)
    beside = (x >= left - 0.05) & (x <= left + width + 0.02)
    count = 0
    for values in (panel.values, *(bound.values for bound in panel.bounds)):
        y = (values - low) / (high - low)
        count += int((beside & (y >= bottom - 0.1) & (y <= bottom + height + 0.05)).sum())
    return count


def plot_panel(ax: "Axes", panel: Panel, critical: str = _CRITICAL) -> None:
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
        ax.plot(panel.times[k], panel.values[k], "o", color=critical, markersize=5)
    if panel.points:
        ax.plot(*zip(*panel.points, strict=True), "o", color=_INPUT, markersize=3.5)
    if panel.limits is not None:
        low, high = panel.limits
        margin = 0.06 * (high - low)
        ax.set_ylim(low - margin, high + margin)
        for limit in panel.limits:
            ax.axhline(limit, color=_WINDOW, linewidth=0.6, linestyle=":")
    if panel.labels is not None:
        whole_ticks(ax.yaxis, panel.labels)
    for bound in panel.bounds[:_LABELLED]:
        _name_bound(ax, panel, bound)
    ax.set_ylabel(caption(panel.title))


def _name_bound(ax: "Axes", panel: Panel, bound: Bound) -> None:
    """Write a predicate beside the line of its bound, on the side on which there is room."""
    within = (panel.times >= bound.start) & (panel.times <= bound.end)
    if not within.any():
        return
    at = float(panel.times[within][0]), float(bound.values[within][0])
    low, high = ax.get_ylim()
    side, offset = ("top", -3) if at[1] > low + _TOP * (high - low) else ("bottom", 2)
    text, where = caption(bound.predicate), (3, offset)
    ax.annotate(text, at, where, textcoords="offset points", va=side, color=_BOUND, fontsize=8)


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure; the file extension determines the format."""
    figure.savefig(path, dpi=130)


def png(figure: "Figure", *, dpi: int) -> bytes:
    """Return a figure as the content of a PNG file."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()
