"""New axes, and the figure that axes belong to; without pyplot, which keeps global state."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def own_axes(width: float = 8.0, height: float = 4.0) -> "Axes":
    """Make axes that fill a new figure of this size in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained").subplots()


def figure_of(ax: "Axes") -> "Figure":
    """The figure that axes belong to."""
    from matplotlib.figure import Figure

    figure = ax.get_figure(root=True)
    assert isinstance(figure, Figure)
    return figure
