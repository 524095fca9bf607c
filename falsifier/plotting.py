"""Pictures: what was simulated, what decided the verdict, and how a search went.

The only place that imports matplotlib. Every function draws on the axes that it is given, or makes a figure;
nothing here needs a display.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from falsifier.evaluation import Evaluation
from falsifier.problem import Problem
from falsifier.space import InputRange
from falsifier.stl.expression import Number
from falsifier.stl.formula import Always, Eventually, Formula, Predicate, Until

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_OUTPUT, _INPUT, _BOUND, _CRITICAL, _WINDOW = "#1f5fa8", "#2f7d4f", "#b3261e", "#b3261e", "#8a8a8a"
_PANEL_HEIGHT = 1.9


def plot_evaluation(problem: Problem, evaluation: Evaluation) -> "Figure":
    """Figure of one simulation: compared quantities with their bounds and windows, then inputs.

    Args:
        problem: what was searched.
        evaluation: an evaluation with its trajectory.

    Raises:
        ValueError: when the evaluation has no trajectory.
    """
    if evaluation.trajectory is None or evaluation.verdict is None:
        raise ValueError("a simulation that failed has nothing to draw")
    from matplotlib.figure import Figure

    panels = list(_panels(problem.requirement.formula))
    count = len(panels) + len(problem.space.inputs)
    figure = Figure(figsize=(9, 1.0 + _PANEL_HEIGHT * count), layout="constrained")
    axes = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    for ax, (expression, predicates) in zip(axes, panels, strict=False):
        plot_quantity(ax, problem, evaluation, expression, predicates)
    for ax, r in zip(axes[len(panels) :], problem.space.inputs, strict=True):
        plot_input(ax, r, evaluation)
    axes[-1].set_xlabel("time [s]")
    verdict = evaluation.verdict
    parameters = "".join(f"  {name} = {value:.6g}" for name, value in evaluation.candidate.parameters.items())
    figure.suptitle(
        f"{problem.name}: robustness {verdict.robustness:+.5g}, decided at t = {verdict.critical_time:.5g} s"
        + parameters,
        fontsize=11,
    )
    return figure


def plot_quantity(
    ax: "Axes",
    problem: Problem,
    evaluation: Evaluation,
    expression: str,
    predicates: "list[tuple[Predicate, tuple[float, float]]]",
) -> None:
    """Draw one compared quantity with its bounds, the windows in which they count and the critical time."""
    trajectory, verdict = evaluation.trajectory, evaluation.verdict
    if trajectory is None or verdict is None:
        raise ValueError("a simulation that failed has nothing to draw")
    values = np.broadcast_to(_sides(predicates[0][0])[0].evaluate(trajectory.columns), trajectory.times.shape)
    ax.plot(trajectory.times, values, color=_OUTPUT, linewidth=1.2)
    for predicate, window in predicates:
        bound = np.broadcast_to(_sides(predicate)[1].evaluate(trajectory.columns), trajectory.times.shape)
        end = min(window[1], float(trajectory.times[-1]))
        within = (trajectory.times >= window[0]) & (trajectory.times <= end)
        ax.plot(trajectory.times[within], bound[within], color=_BOUND, linewidth=1.2, linestyle="--")
        ax.axvspan(window[0], end, color=_WINDOW, alpha=0.08, linewidth=0)
    ax.axvline(verdict.critical_time, color=_CRITICAL, linewidth=0.8, linestyle=":")
    if any(str(predicate) == verdict.predicate for predicate, _ in predicates):
        k = trajectory.index(verdict.critical_time)
        ax.plot(trajectory.times[k], values[k], "o", color=_CRITICAL, markersize=5)
    units = {trajectory.units.get(name, "") for name in _sides(predicates[0][0])[0].signals} - {""}
    ax.set_ylabel(expression + (f" [{units.pop()}]" if len(units) == 1 else ""))


def plot_input(ax: "Axes", r: InputRange, evaluation: Evaluation) -> None:
    """Draw one input signal with its control points and its range."""
    signal = evaluation.candidate.signals[r.name]
    if evaluation.trajectory is not None:
        times = evaluation.trajectory.times
        style = "steps-post" if signal.interpolation == "constant" else "default"
        ax.plot(times, signal.held(None).sample(times), color=_INPUT, linewidth=1.2, drawstyle=style)
    ax.plot(signal.times, signal.values, "o", color=_INPUT, markersize=3.5)
    margin = 0.06 * (r.high - r.low)
    ax.set_ylim(r.low - margin, r.high + margin)
    for limit in (r.low, r.high):
        ax.axhline(limit, color=_WINDOW, linewidth=0.6, linestyle=":")
    ax.set_ylabel(r.name + (f" [{r.unit}]" if r.unit else ""))


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure; the file's ending decides the format."""
    figure.savefig(path, dpi=130)


def judged_windows(
    formula: Formula, start: float = 0.0, end: float = 0.0
) -> Iterator[tuple[Predicate, tuple[float, float]]]:
    """Yield each predicate with the earliest and latest time in s at which its value counts.

    Operators without a bound reach to infinity.
    """
    if isinstance(formula, Predicate):
        yield formula, (start, end)
        return
    if isinstance(formula, Always | Eventually | Until):
        window = formula.window
        begin, finish = (window.start, window.end) if window else (0.0, np.inf)
        # The left operand of until counts from the operator's own time on.
        start, end = (start if isinstance(formula, Until) else start + begin), end + finish
    for child in formula.children:
        yield from judged_windows(child, start, end)


def _panels(formula: Formula) -> Iterator[tuple[str, list[tuple[Predicate, tuple[float, float]]]]]:
    """Yield each compared quantity with its predicates and their windows, in order of first appearance."""
    panels: dict[str, list[tuple[Predicate, tuple[float, float]]]] = {}
    for predicate, window in judged_windows(formula):
        panels.setdefault(str(_sides(predicate)[0]), []).append((predicate, window))
    yield from panels.items()


def _sides(predicate: Predicate) -> tuple[Any, Any]:
    """Varying side, then the side that it is compared with."""
    if isinstance(predicate.left, Number):
        return predicate.right, predicate.left
    return predicate.left, predicate.right
