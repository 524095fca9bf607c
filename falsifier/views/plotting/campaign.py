"""Figures of runs and campaigns."""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from falsifier.campaigns.analysis import Run, Statistics, group, statistics
from falsifier.campaigns.analysis.curves import falsification_curve
from falsifier.core.words import counted
from falsifier.views.plotting.axes import caption, figure_of, own_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_VALUE, _BEST, _ZERO, _FOUND = "#9aa7b5", "#1f5fa8", "#8a8a8a", "#b3261e"


def plot_history(run: Run, ax: "Axes | None" = None) -> "Figure":
    """Plot the robustness of each simulation of a run, the smallest so far, and the counterexample.

    Args:
        run: a run returned by load or load_run.
        ax: where to draw; None: a new figure.
    """
    ax = ax if ax is not None else own_axes()
    numbers = np.arange(1, len(run.robustness) + 1)
    ax.plot(numbers, run.robustness, ".", color=_VALUE, markersize=4, label="robustness")
    ax.step(numbers, run.best_so_far, where="post", color=_BEST, linewidth=1.4, label="smallest so far")
    ax.axhline(0, color=_ZERO, linewidth=0.8, linestyle="--")
    if run.counterexample is not None:
        found = run.counterexample
        ax.plot(found + 1, run.robustness[found], "o", color=_FOUND, label="counterexample")
    ax.set(xlabel="simulation", ylabel="robustness", title=caption(f"{run.requirement}: {run.method.label}"))
    ax.legend()
    return figure_of(ax)


def plot_rates(runs: Iterable[Run], ax: "Axes | None" = None) -> "Figure":
    """Plot the share of falsified runs over the number of simulations, one curve per method."""
    ax = ax if ax is not None else own_axes()
    by_method: dict[str, list[Run]] = {}
    for run in runs:
        by_method.setdefault(run.method.label, []).append(run)
    for label, members in by_method.items():
        counts, shares = falsification_curve(members)
        name = caption(f"{label} ({counted(len(members), 'run')})")
        ax.step(counts, shares, where="post", linewidth=1.6, label=name)
    ax.set(xlabel="simulations", ylabel="share of falsified runs", ylim=(-0.03, 1.03))
    if by_method:
        ax.legend()
    return figure_of(ax)


def plot_comparison(runs: Iterable[Run], ax: "Axes | None" = None) -> "Figure":
    """Plot the mean number of simulations until falsification with standard deviation, one bar per method."""
    cells = {key: statistics(members) for key, members in group(runs).items()}
    requirements = list(dict.fromkeys(requirement for requirement, _ in cells))
    methods = list(dict.fromkeys(method for _, method in cells))
    ax = ax if ax is not None else own_axes(max(6.0, 1.2 * len(requirements)))
    width = 0.8 / max(len(methods), 1)
    for i, method in enumerate(methods):
        found = [cells.get((requirement, method)) for requirement in requirements]
        at = np.arange(len(requirements)) + (i - (len(methods) - 1) / 2) * width
        means = _each(found, lambda s: s.mean)
        bars = ax.bar(
            at,
            means,
            width,
            yerr=_each(found, lambda s: s.deviation),
            label=caption(method.label),
            capsize=2,
        )
        ax.bar_label(bars, [f"{s.falsified}/{s.runs}" if s else "" for s in found], fontsize=7, padding=2)
    ax.set_xticks(np.arange(len(requirements)), list(map(caption, requirements)))
    ax.set(ylabel="simulations (mean, standard deviation)")
    ax.legend()
    return figure_of(ax)


def _each(found: Sequence[Statistics | None], value: Callable[[Statistics], float | None]) -> list[float]:
    """The value of each; 0 without one, so that matplotlib draws no bar."""
    return [(value(s) or 0.0) if s is not None else 0.0 for s in found]
