"""Figure of the neighbourhood of a counterexample or a near miss."""

from typing import TYPE_CHECKING, Any

import numpy as np

from falsifier.counterexamples.robustness_map import RobustnessMap
from falsifier.views.plotting.axes import caption

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_VIOLATES, _HOLDS, _ZERO = "#b3261e", "#1f5fa8", "#8a8a8a"


def plot_robustness_map(found: RobustnessMap, title: str = "") -> "Figure":
    """Plot robustness over the size of the change, and over the two most influential inputs."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    _plot_sizes(left, found)
    if len(found.grid) > 1:
        _plot_map(right, found)
    else:
        _plot_line(right, found)
    figure.suptitle(f"{caption(title)}: robustness around the {_centre(found)}".removeprefix(": "))
    return figure


def _centre(found: RobustnessMap) -> str:
    return "counterexample" if found.original < 0 else "nearest miss"


def _colour(found: RobustnessMap) -> str:
    return _VIOLATES if found.original < 0 else _HOLDS


def _plot_sizes(ax: "Axes", found: RobustnessMap) -> None:
    violates = found.robustness < 0
    for mask, color, label in ((violates, _VIOLATES, "violated"), (~violates, _HOLDS, "satisfied")):
        if mask.any():
            ax.plot(found.sizes[mask], found.robustness[mask], ".", color=color, markersize=4, label=label)
    ax.plot(0.0, found.original, "o", color=_colour(found), label=_centre(found))
    ax.axhline(0, color=_ZERO, linewidth=0.8, linestyle="--")
    ax.set(xlabel="largest change of an input, share of its range", ylabel="robustness")
    ax.legend()


def _plot_map(ax: "Axes", found: RobustnessMap) -> None:
    first, second = (found.coordinates[i] for i in found.axes)
    mesh = ax.pcolormesh(*found.grid, found.surface, shading="nearest", **_scale(found))
    if (found.surface < 0).any() and (found.surface >= 0).any():
        ax.contour(*found.grid, found.surface, levels=[0.0], colors="black", linewidths=1.0)
    ax.plot(first.value, second.value, "o", color="black", markersize=5)
    ax.set(xlabel=caption(first.label), ylabel=caption(second.label))
    ax.figure.colorbar(mesh, ax=ax, label="robustness (< 0: violated)")


def _scale(found: RobustnessMap) -> dict[str, Any]:
    """Return a colour scale: red and blue from 0 if some of it is violated, otherwise from the smallest."""
    low, high = float(np.nanmin(found.surface)), float(np.nanmax(found.surface))
    if low > 0:
        return {"cmap": "Blues", "vmin": low, "vmax": high}
    largest = max(-low, high) or 1.0
    return {"cmap": "RdBu", "vmin": -largest, "vmax": largest}


def _plot_line(ax: "Axes", found: RobustnessMap) -> None:
    coordinate = found.coordinates[found.axes[0]]
    ax.plot(found.grid[0], found.surface[0], color=_HOLDS, linewidth=1.2)
    ax.plot(coordinate.value, found.original, "o", color=_colour(found))
    ax.axhline(0, color=_ZERO, linewidth=0.8, linestyle="--")
    ax.set(xlabel=caption(coordinate.label), ylabel="robustness")
