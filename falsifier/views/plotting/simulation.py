"""Figures of one simulation: what was required, what broke or decided, and the inputs."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from falsifier.core.arguments import instance
from falsifier.core.ranges import number_names
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import candidate_facts, readable, shortened, with_unit
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.search.result import Result
from falsifier.stl.margins import is_on_limit, signed
from falsifier.stl.monitor import Verdict
from falsifier.views.plotting.axes import (
    CHARACTER,
    Colour,
    caption,
    figure_of,
    fit_labels,
    new_figure,
    own_axes,
    whole_ticks,
    wrapped,
)
from falsifier.views.plotting.panels import Panel, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# In inches, low for what is compared with nothing; and the number of characters of a title's line.
_PANEL_HEIGHT, _LOW_HEIGHT, _LINE_HEIGHT, _TITLE_WIDTH = 1.9, 1.3, 0.18, 110
# A margin below this share of a panel's height is enlarged, with this share of the simulated time around it.
_HIDDEN, _ENLARGED = 0.02, 0.1
# There, the margin should be at least this share of what the quantity does, over at least so many samples.
_SEEN, _FEWEST_SAMPLES = 0.2, 5
# Places for the enlarged part: left, bottom, width and height as shares of the panel.
_CORNERS = [
    (x, y, width, 0.42) for x, width in ((0.62, 0.35), (0.07, 0.35), (0.35, 0.25)) for y in (0.12, 0.52)
]
# Maximum number of bounds in a panel whose predicates are written beside them.
_LABELLED = 3
# Share of a panel's height above which a predicate is written below its line, and below which the predicates
# of two lines are written together.
_TOP, _TOGETHER = 0.85, 0.12
# Shorter intervals, as a share of the simulated time, are drawn as a line: a single sample has no width.
_SHORT = 0.003


def plot(shown: Result | Confirmation | Trajectory) -> "Figure":
    """Plot a result, a counterexample or a trajectory.

    Raises:
        SpecError: for anything else.
        ValueError: for a result without a simulation that was judged.
    """
    instance("shown", shown, (Result, Confirmation, Trajectory), "a result, counterexample or trajectory")
    if isinstance(shown, Trajectory):
        return plot_trajectory(shown)
    evaluation = shown.shown if isinstance(shown, Result) else shown.evaluation
    if evaluation is None:
        raise ValueError("nothing to plot: no simulation was judged")
    return plot_evaluation(shown.problem, evaluation)


def plot_evaluation(problem: Problem, evaluation: Evaluation) -> "Figure":
    """Plot one simulation: compared quantities with their bounds and windows, then inputs.

    Raises:
        ValueError: if the evaluation has no trajectory.
    """
    drawn, verdict = _panels(problem, evaluation)
    facts = candidate_facts(evaluation.candidate, problem.space)
    parameters = ", ".join(text for kind, text in facts if kind == "parameter")
    first, *more = _decided(verdict)
    lines = [f"{problem.name}: {first}", *more, str(problem.requirement.formula), parameters]
    return plot_panels(drawn, verdict, "\n".join(wrapped(line, _TITLE_WIDTH) for line in lines if line))


def _panels(problem: Problem, evaluation: Evaluation) -> tuple[list[Panel], Verdict]:
    trajectory, verdict, candidate = evaluation.trajectory, evaluation.verdict, evaluation.candidate
    if trajectory is None or verdict is None:
        raise ValueError("nothing to plot: the simulation failed, or its trajectory was not kept")
    formula, inputs, info = problem.requirement.formula, problem.space.inputs, problem.info
    variables = (v for v in info.variables if v.kind in ("integer", "boolean", "enumeration"))
    labels = {v.name: number_names(v.kind, v.items) for v in variables}
    return panels(formula, trajectory, candidate, inputs, verdict, labels, info.components), verdict


def plot_panels(drawn: Sequence[Panel], verdict: Verdict | None, title: str = "") -> "Figure":
    """Plot the quantities of one simulation, at least one, below each other, with a legend.

    The title may have several lines; without a verdict, nothing is marked.
    """
    heights = [_PANEL_HEIGHT if panel.bounds else _LOW_HEIGHT for panel in drawn]
    height = sum(heights) + _LINE_HEIGHT * (title.count("\n") + 1)
    figure = new_figure(9, 0.8 + height)
    axes = figure.subplots(len(drawn), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    group = ""
    for ax, panel in zip(axes, drawn, strict=True):
        plot_panel(ax, panel, verdict)
        if panel.component != group:
            group = panel.component
            ax.set_title(caption(group), loc="left", fontsize=9, weight="bold")
        if verdict is not None:
            _mark_moment(ax, panel, verdict)
    axes[-1].set_xlabel("time [s]")
    if title:
        figure.suptitle(title, fontsize=10)
    keys = {label: mark for ax in axes for mark, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    if keys:
        place: dict[str, Any] = {"loc": "outside lower center", "ncols": len(keys), "fontsize": 8}
        figure.legend(keys.values(), keys.keys(), frameon=False, **place)
    return figure


def _decided(verdict: Verdict) -> list[str]:
    by, at = verdict.predicate, f"{readable(verdict.critical_time)} s"
    decided = f"robustness {signed(verdict.robustness)}, decided by {by} at {at}"
    if verdict.breach is not None:
        return [*verdict.breach.lines, decided]
    return [f"{'violated' if verdict.violated else 'not violated'}, {decided}"]


def _decided_colour(verdict: Verdict | None) -> str:
    return Colour.VIOLATED if verdict is None or verdict.violated else Colour.NEAREST


def _mark_moment(ax: "Axes", panel: Panel, verdict: Verdict) -> None:
    """Mark the time to look at; enlarge a margin that is too small to be seen at the scale of the panel."""
    low, high = ax.get_ylim()
    if panel.critical == verdict.moment and 0 < _margin(verdict) < _HIDDEN * (high - low):
        _plot_inset(ax, panel, verdict)
    ax.axvline(verdict.moment, color=_decided_colour(verdict), linewidth=0.8, linestyle=":")


def _margin(verdict: Verdict) -> float:
    """How far the marked quantity is from its limit."""
    if verdict.breach is not None:
        return abs(verdict.breach.main.value - verdict.breach.main.limit)
    return 0.0 if is_on_limit(verdict.robustness) else abs(verdict.robustness)


def plot_requirement(problem: Problem, evaluation: Evaluation, ax: "Axes | None" = None) -> "Figure":
    """Plot the quantity that broke, or else decided the verdict, with its bound, its window and that time.

    It is drawn on the given axes, or in a new figure.

    Raises:
        ValueError: if the evaluation has no trajectory.
    """
    drawn, verdict = _panels(problem, evaluation)
    ax = ax if ax is not None else own_axes(8, 3)
    decisive = next(panel for panel in drawn if panel.critical == verdict.moment)
    plot_panel(ax, decisive, verdict)
    _mark_moment(ax, decisive, verdict)
    ax.set_xlabel("time [s]")
    ax.set_title("\n".join(wrapped(line, _TITLE_WIDTH) for line in _decided(verdict)), fontsize=10)
    return figure_of(ax)


def _enlarged(panel: Panel, verdict: Verdict) -> float:
    """Return how much time in s around the marked one to enlarge, so that the margin is seen."""
    length = _ENLARGED * float(panel.times[-1])
    while True:
        near = panel.values[abs(panel.times - verdict.moment) <= length / 4]
        if len(near) < _FEWEST_SAMPLES or _margin(verdict) > _SEEN * float(np.ptp(near)):
            return length
        length /= 2


def _plot_inset(ax: "Axes", panel: Panel, verdict: Verdict) -> None:
    """Draw the panel again, enlarged around the marked time, in the emptiest corner."""
    critical, length = verdict.moment, _enlarged(panel, verdict)
    inside = ax.inset_axes(min(_CORNERS, key=lambda corner: _covered(ax, corner)))
    plot_panel(inside, panel, verdict)
    for text in inside.texts:
        text.set_visible(False)
    inside.set(xlim=(critical - length / 2, critical + length / 2), ylabel="")
    near, k = abs(panel.times - critical) <= length / 4, abs(panel.times - critical).argmin()
    # Of several limits, the one that has this margin: others may be far off.
    bound = min(panel.bounds, key=lambda b: abs(abs(b.values[k] - panel.values[k]) - _margin(verdict)))
    within = near & (panel.times >= bound.start) & (panel.times <= bound.end)
    values = panel.values[near], bound.values[within]
    low, high = min(v.min() for v in values if v.size), max(v.max() for v in values if v.size)
    margin = 0.1 * (high - low) or 1.0
    inside.set_ylim(low - margin, high + margin)
    inside.tick_params(labelsize=7)
    inside.locator_params(axis="x", nbins=4)  # it is narrow, and times of microseconds are long
    ax.indicate_inset_zoom(inside)


def _covered(ax: "Axes", corner: tuple[float, float, float, float]) -> int:
    """Return how many samples of a panel, and of its bounds, an inset would cover; the curve counts most."""
    left, bottom, width, height = corner
    points = np.concatenate([line.get_xydata() for line in (*ax.get_lines()[:1] * 2, *ax.get_lines())])
    x, y = ax.transLimits.transform(points).T  # as shares of the panel
    beside = (x >= left - 0.05) & (x <= left + width + 0.02)
    return int((beside & (y >= bottom - 0.2) & (y <= bottom + height + 0.05)).sum())


def plot_panel(ax: "Axes", panel: Panel, verdict: Verdict | None) -> None:
    """Draw a quantity with its bounds, windows and critical point, or an input with its control points."""
    critical = _decided_colour(verdict)
    marked = "farthest off" if verdict is not None and verdict.violated else "nearest to a violation"
    color = Colour.INPUT if panel.limits is not None else Colour.OUTPUT
    style = "steps-post" if panel.steps else "default"
    ax.plot(panel.times, panel.values, color=color, linewidth=1.2, drawstyle=style)
    for bound in panel.bounds:
        within = (panel.times >= bound.start) & (panel.times <= bound.end)
        line: dict[str, Any] = {"linestyle": "--"} if within.sum() > 1 else {"marker": "_", "markersize": 16}
        limit = panel.times[within], bound.values[within]
        ax.plot(*limit, color=Colour.LIMIT, linewidth=1.2, label="limit", **line)
        counts = "time in which it counts" if not within.all() else None
        _shade(ax, panel, (bound.start, bound.end), color=Colour.QUIET, alpha=0.08, label=counts)
    for interval in panel.broken:
        _shade(ax, panel, interval, color=critical, alpha=0.15, label="violated (worst interval)")
    decided = "decided the robustness"
    for time, filling, label in ((panel.critical, critical, marked), (panel.decided, "none", decided)):
        if time is not None:
            k = abs(panel.times - time).argmin()
            at = panel.times[k], panel.values[k]
            ax.plot(*at, "o", color=critical, markersize=5, markerfacecolor=filling, label=label)
    if panel.points:
        points = zip(*panel.points, strict=True)
        ax.plot(*points, "o", color=Colour.INPUT, markersize=3.5, label="control point of an input")
    if panel.limits is not None:
        low, high = panel.limits
        margin = 0.06 * (high - low) or 1.0
        ax.set_ylim(low - margin, high + margin)
        for end in panel.limits:
            ax.axhline(end, color=Colour.QUIET, linewidth=0.6, linestyle=":")
    if panel.labels is not None:
        whole_ticks(ax.yaxis, panel.labels)
    _name_bounds(ax, panel)
    ax.set_ylabel(caption(panel.title))
    fit_labels(ax)


def _shade(ax: "Axes", panel: Panel, interval: tuple[float, float], **look: Any) -> None:
    """Shade an interval of time, so that it is seen also if it is very short."""
    start, end = interval
    ax.axvspan(start, end, linewidth=3 if end - start < _SHORT * panel.times[-1] else 0, **look)


def _name_bounds(ax: "Axes", panel: Panel) -> None:
    """Write predicates beside the lines of their bounds, on the side on which there is room.

    Those of lines that lie close to each other are written together.
    """
    from matplotlib.patheffects import withStroke

    (first, last), (low, high) = ax.get_xlim(), ax.get_ylim()
    inches = ax.get_window_extent().width / figure_of(ax).dpi
    named: dict[tuple[float, float], dict[str, float]] = {}  # predicates and ends of windows by place
    for bound in panel.bounds[:_LABELLED]:
        within = (panel.times >= bound.start) & (panel.times <= bound.end)
        if within.any():
            x, y, end = panel.times[within][0], bound.values[within][0], panel.times[within][-1]
            near = ((u, v) for u, v in named if u == x and abs(v - y) < _TOGETHER * (high - low))
            named.setdefault(next(near, (x, y)), {})[bound.predicate] = end
    for (x, y), ends in named.items():
        side, offset = ("top", -3) if y > low + _TOP * (high - low) else ("bottom", 2)
        text = shortened(", ".join(ends), int(inches / CHARACTER))
        is_late = len(text) * CHARACTER > (last - x) / (last - first) * inches
        at, where, align = ((max(ends.values()), y), -3, "right") if is_late else ((x, y), 3, "left")
        look: dict[str, Any] = {"va": side, "ha": align, "color": Colour.LIMIT, "fontsize": 8}
        look["path_effects"] = [withStroke(linewidth=2, foreground="white", alpha=0.7)]
        ax.annotate(caption(text), at, (where, offset), textcoords="offset points", **look)


def plot_trajectory(trajectory: Trajectory, names: Sequence[str] | None = None) -> "Figure":
    """Plot signals over time, those named or else all, one small panel per signal."""
    shown = [
        Panel(with_unit(name, trajectory.units.get(name, "")), trajectory.times, trajectory[name])
        for name in (trajectory.names if names is None else names)
    ]
    return plot_panels(shown, None)
