"""Figures of what a run has tried, and of the neighbourhood of a counterexample or a near miss."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from falsifier.analyses.coverage import Coverage, OutputCoverage, PairCoverage, RangeCoverage, edges_of
from falsifier.core.ranges import number_names
from falsifier.core.words import counted, with_unit
from falsifier.counterexamples.robustness_map import RobustnessMap
from falsifier.views.plotting.axes import Colour, caption, fit_labels, new_figure, set_scale, whole_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

# What was never tried is red, as gaps must strike the eye; the more simulations, the darker the blue.
_NEVER, _TRIED = "#f2b8b0", "#9dbbe0"
# A figure has at most this many panels of each kind: inputs, parameters, pairs, outputs.
_PANELS = 8
_COLUMNS = 4


def plot_coverage(found: Coverage, title: str = "") -> "Figure":
    """Plot what was tried of inputs over time, of parameters and of pairs, and the band of each output.

    Of each kind, the first eight are drawn; the pairs are the least tried ones.
    """
    by_name = {r.searched.name: r for r in found.ranges}
    inputs = [r for r in found.ranges if r.times is not None]
    parameters = [r for r in found.ranges if r.times is None]
    drawn: list[Callable[[Axes], None]] = [
        *(partial(_plot_input, r=r, stop_time=found.stop_time) for r in inputs[:_PANELS]),
        *(partial(_plot_parameter, r=r) for r in parameters[:_PANELS]),
        *(partial(_plot_pair, p=p, by_name=by_name) for p in found.pairs[:_PANELS]),
        *(partial(_plot_output, o=o) for o in found.outputs[:_PANELS]),
    ]
    columns = min(_COLUMNS, max(1, len(drawn)))
    rows = max(1, -(-len(drawn) // columns))
    figure = new_figure(3.4 * columns + 0.6, 2.7 * rows + 0.5)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, draw in zip(axes, drawn, strict=False):
        draw(ax)
        fit_labels(ax)
    for ax in axes[len(drawn) :]:
        ax.set_axis_off()
    tried = counted(found.simulations, "simulation")
    figure.suptitle(f"{caption(title)}: what {tried} tried (red: never)".removeprefix(": "), fontsize=11)
    return figure


def _plot_input(ax: "Axes", r: RangeCoverage, stop_time: float) -> None:
    assert r.times is not None
    _heat(ax, np.linspace(0.0, stop_time, len(r.times) + 1), _ends(r), r.times.T)
    ax.set(xlabel="time [s]", ylabel=_label(r), title="simulations by value and time")
    ax.title.set_fontsize(9)
    _whole(ax.yaxis, r)


def _plot_parameter(ax: "Axes", r: RangeCoverage) -> None:
    from matplotlib.ticker import MaxNLocator

    ends = _ends(r)
    for low, high, count in zip(ends, ends[1:], r.parts, strict=False):
        if count:
            ax.bar(low, count, width=high - low, align="edge", color=_TRIED, edgecolor="white")
        else:
            ax.axvspan(low, high, color=_NEVER, linewidth=0)
    ax.set(xlabel=_label(r), ylabel="simulations", xlim=(ends[0], ends[-1]))
    set_scale(ax, x=r.searched.scale)
    _whole(ax.xaxis, r)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))


def _plot_pair(ax: "Axes", p: PairCoverage, by_name: dict[str, RangeCoverage]) -> None:
    first, second = by_name[p.first], by_name[p.second]
    _heat(ax, _ends(first), _ends(second), p.tried.T.astype(np.intp))
    ax.set(xlabel=_label(first), ylabel=_label(second))
    set_scale(ax, x=first.searched.scale, y=second.searched.scale)
    ax.set_title(f"{p.count} of {p.tried.size} combinations", fontsize=9)
    _whole(ax.xaxis, first)
    _whole(ax.yaxis, second)


def _plot_output(ax: "Axes", o: OutputCoverage) -> None:
    ax.fill_between(o.times, o.lows, o.highs, color=_TRIED, linewidth=0)
    for line in (o.lows, o.highs):
        ax.plot(o.times, line, color=Colour.OUTPUT, linewidth=0.8)
    ax.set(xlabel="time [s]", ylabel=caption(with_unit(o.name, o.unit)))
    ax.set_title("smallest and largest value", fontsize=9)


def _heat(ax: "Axes", xs: NDArray[np.float64], ys: NDArray[np.float64], counts: NDArray[np.intp]) -> None:
    """Draw counts by cell: never tried red, otherwise a blue that darkens with the count."""
    from matplotlib import colormaps

    colours = colormaps["Blues"].with_extremes(under=_NEVER)
    # From below 0: a single simulation must be told from the white of the paper.
    shown = np.where(counts > 0, counts / max(1.0, float(counts.max(initial=0))) + 0.3, -1.0)
    ax.pcolormesh(xs, ys, shown, cmap=colours, vmin=0.0, vmax=1.3, edgecolors="white", linewidth=0.3)


def _ends(r: RangeCoverage) -> NDArray[np.float64]:
    """Return the ends of the parts, shape (parts + 1,); whole numbers stand in the middle of theirs."""
    if numbers := _scattered(r):
        return np.arange(-0.5, len(numbers), dtype=np.float64)
    edges = np.array(edges_of(r.searched))
    if len(edges) == 1 or edges[0, 0] == edges[0, 1]:
        return np.array([*(edges[:, 0] - 0.5), edges[-1, 1] + 0.5])
    return np.array([*edges[:, 0], edges[-1, 1]])


def _scattered(r: RangeCoverage) -> list[int]:
    """Return the numbers of an enumeration with gaps, such as 1, 2 and 255: they are drawn side by side."""
    numbers = [int(low) for low, _ in edges_of(r.searched)] if r.searched.items else []
    return numbers if any(b - a > 1 for a, b in pairwise(numbers)) else []


def _whole(axis: "Axis", r: RangeCoverage) -> None:
    """Put the ticks of an integer, Boolean or enumeration at its numbers, with their names."""
    if r.searched.kind != "real":
        low, high = r.searched.low, r.searched.high
        names = number_names(r.searched.kind, r.searched.items)
        if numbers := _scattered(r):
            whole_ticks(axis, {place: names[number] for place, number in enumerate(numbers)})
        else:
            whole_ticks(axis, {number: name for number, name in names.items() if low <= number <= high})


def _label(r: RangeCoverage) -> str:
    return caption(with_unit(r.searched.name, r.searched.unit))


def plot_robustness_map(found: RobustnessMap, title: str = "") -> "Figure":
    """Plot robustness over the size of the change, and over the two most influential inputs."""
    figure = new_figure(11, 4.4)
    left, right = figure.subplots(1, 2)
    centre, colour = "nearest miss", Colour.OUTPUT
    if found.original < 0:
        centre, colour = "counterexample", Colour.VIOLATED
    for mask, color, label in (  # of simulations that failed, neither is said
        (found.robustness < 0, Colour.VIOLATED, "violated"),
        (found.robustness >= 0, Colour.OUTPUT, "satisfied"),
    ):
        if mask.any():
            left.plot(found.sizes[mask], found.robustness[mask], ".", color=color, markersize=4, label=label)
    left.axhline(0, color=Colour.QUIET, linewidth=0.8, linestyle="--")
    left.set(xlabel="largest change of an input, share of its range", ylabel="robustness")
    left.plot(0.0, found.original, "o", color=colour, label=centre)
    left.legend()
    if len(found.grid) > 1:
        _plot_map(right, found)
    else:
        coordinate = found.coordinates[found.axes[0]]
        right.plot(found.grid[0], found.surface[0], color=Colour.OUTPUT, linewidth=1.2)
        right.plot(coordinate.value, found.original, "o", color=colour)
        right.axhline(0, color=Colour.QUIET, linewidth=0.8, linestyle="--")
        right.set(xlabel=caption(coordinate.label), ylabel="robustness")
        set_scale(right, x=coordinate.scale)
    fit_labels(right)
    figure.suptitle(f"{caption(title)}: robustness around the {centre}".removeprefix(": "))
    return figure


def _plot_map(ax: "Axes", found: RobustnessMap) -> None:
    from matplotlib.colors import TwoSlopeNorm

    first, second = (found.coordinates[i] for i in found.axes)
    known = found.surface[np.isfinite(found.surface)]
    low, high = (float(end(known, initial=found.original)) for end in (np.min, np.max))
    # Red, for violations, begins at 0 and is seen however small they are.
    largest = max(-low, high) or 1.0
    ends = low if low < 0 else -largest, high if high > 0 else largest
    norm = TwoSlopeNorm(0.0, *ends)
    mesh = ax.pcolormesh(*found.grid, found.surface, shading="nearest", cmap="RdBu", norm=norm)
    if low < 0 <= high:
        ax.contour(*found.grid, found.surface, levels=[0.0], colors="black", linewidths=1.0)
    elif low < high:  # one colour: lines show which way it changes
        ax.clabel(ax.contour(*found.grid, found.surface, levels=4, colors="black", linewidths=0.5))
    ax.plot(first.value, second.value, "o", color="black", markersize=5)
    ax.set(xlabel=caption(first.label), ylabel=caption(second.label))
    set_scale(ax, x=first.scale, y=second.scale)
    ticks = [ends[0], ends[0] / 2, 0.0, ends[1] / 2, ends[1]]  # on both halves, whose scales differ
    ax.figure.colorbar(mesh, ax=ax, label="robustness (red: violated)", ticks=ticks, format="%.3g")
