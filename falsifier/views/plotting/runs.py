"""Figures of runs and campaigns."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from falsifier.campaigns.analysis import Run, group, statistics
from falsifier.core.words import counted
from falsifier.views.plotting.axes import Colour, caption, figure_of, own_axes, whole_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Curve = tuple[NDArray[np.float64], NDArray[np.float64]]

# Maximum number of simulations drawn per run.
_MOST_DRAWN = 1000


def plot_history(runs: Run | Iterable[Run], ax: "Axes | None" = None) -> "Figure":
    """Plot the robustness of each simulation of one or more runs, the smallest so far, and counterexamples.

    The title is that of the first run. Of a long one, the smallest robustness in each of a thousand equal
    parts is drawn.
    """
    ax = ax if ax is not None else own_axes(9.0, 3.2)
    runs = [runs] if isinstance(runs, Run) else list(runs)
    for run in runs:
        each = thinned(run.robustness, _MOST_DRAWN)
        ax.plot(*each, ".", color=Colour.EACH, markersize=4, label="robustness")
        numbers, smallest = improvements(run.robustness)
        last = smallest[-1:]  # until the end; none if no simulation was judged
        until = (np.append(numbers, np.full(len(last), len(run.robustness))), np.append(smallest, last))
        ax.step(*until, where="post", color=Colour.OUTPUT, linewidth=1.4, label="smallest so far")
        if run.counterexample is not None:
            found = run.counterexample
            ax.plot(found + 1, run.robustness[found], "o", color=Colour.VIOLATED, label="counterexample")
    ax.axhline(0, color=Colour.QUIET, linewidth=0.8, linestyle="--")
    ax.set(xlabel="simulation", ylabel="robustness")
    whole_ticks(ax.xaxis, {})
    if runs:
        ax.set_title(caption(f"{runs[0].requirement}: {runs[0].method.label}"))
    entries = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    if entries:
        ax.legend(entries.values(), entries.keys())
    return figure_of(ax)


def plot_rates(runs: Iterable[Run], ax: "Axes | None" = None) -> "Figure":
    """Plot the share of falsified runs over the number of simulations, one curve per method."""
    ax = ax if ax is not None else own_axes()
    runs = list(runs)
    for k, method in enumerate(dict.fromkeys(run.method for run in runs)):
        members = [run for run in runs if run.method == method]
        counts, shares = falsification_curve(members)
        name = caption(f"{method.label} ({counted(sum(run.counts for run in members), 'run')})")
        style = ("-", "--", "-.", ":")[k % 4]  # also seen without colours, and upon another
        ax.step(counts, shares, where="post", linewidth=1.6, linestyle=style, label=name)
    ax.set(xlabel="simulations", ylabel="share of falsified runs", ylim=(-0.03, 1.03))
    whole_ticks(ax.xaxis, {})
    if runs:
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
        # 0 without a value, so that matplotlib draws no bar.
        means = [(s.mean or 0.0) if s else 0.0 for s in found]
        deviations = [(s.deviation or 0.0) if s else 0.0 for s in found]
        bars = ax.bar(at, means, width, yerr=deviations, label=caption(method.label), capsize=2)
        rates = [f"{s.falsified_runs}/{s.runs}" if s else "" for s in found]
        ax.bar_label(bars, rates, fontsize=7, padding=2)
    ax.set_xticks(np.arange(len(requirements)), list(map(caption, requirements)))
    ax.set(ylabel="simulations (mean, standard deviation)")
    if methods:
        ax.legend()
    return figure_of(ax)


def falsification_curve(runs: Iterable[Run]) -> Curve:
    """Share of finished runs that are falsified, over the number of simulations.

    Returns:
        Numbers of simulations, from 0 to the most of these runs, and the share at each, both of shape (k,);
        the share is constant between two numbers.
    """
    finished = [run for run in runs if run.counts]
    counts = sorted(run.simulations for run in finished if run.falsified)
    shares = np.arange(len(counts) + 1) / max(len(finished), 1)
    largest = max((run.simulations for run in finished), default=0)
    return np.array([0.0, *counts, largest]), np.append(shares, shares[-1])


def thinned(robustness: NDArray[np.float64], limit: int) -> Curve:
    """Robustness values for drawing: all of them, or the lowest in each of ``limit`` equal parts.

    Returns:
        Numbers of the simulations, from 1, and their values; without NaN.
    """
    valid = np.flatnonzero(~np.isnan(robustness))
    if len(valid) > limit:
        valid = np.array([part[np.argmin(robustness[part])] for part in np.array_split(valid, limit)])
    return (valid + 1).astype(np.float64), robustness[valid]


def improvements(robustness: NDArray[np.float64]) -> Curve:
    """Simulations that improve on the smallest robustness so far: their numbers, from 1, and the values."""
    best = np.fmin.accumulate(np.append(np.inf, robustness))
    at = np.flatnonzero(best[1:] < best[:-1])
    return (at + 1).astype(np.float64), robustness[at]
