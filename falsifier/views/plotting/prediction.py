"""Figure that compares an engine's predictions with simulations."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from falsifier.views.plotting.axes import figure_of, own_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_POINT, _ZERO = "#1f5fa8", "#8a8a8a"


def plot_predictions(predicted: ArrayLike, simulated: ArrayLike, ax: "Axes | None" = None) -> "Figure":
    """Plot simulated over predicted robustness, one point per candidate, and the line of equality.

    Args:
        predicted: predicted robustness, shape (n,).
        simulated: simulated robustness, shape (n,).
        ax: where to draw; None: a new figure.
    """
    ax = ax if ax is not None else own_axes(4.5, 4.2)
    x, y = np.asarray(predicted, dtype=np.float64), np.asarray(simulated, dtype=np.float64)
    ends = [float(min(x.min(), y.min())), float(max(x.max(), y.max()))]
    ax.plot(ends, ends, color=_ZERO, linewidth=0.8)
    ax.plot(x, y, ".", color=_POINT, markersize=5)
    ax.axhline(0, color=_ZERO, linewidth=0.8, linestyle="--")
    ax.axvline(0, color=_ZERO, linewidth=0.8, linestyle="--")
    ax.set(xlabel="predicted robustness", ylabel="simulated robustness")
    return figure_of(ax)
