import numpy as np
from matplotlib.figure import Figure

from falsifier.views.plotting import (
    plot_predictions,
)


def test_predictions_lie_on_the_diagonal_where_they_are_right() -> None:
    ax = Figure().subplots()
    plot_predictions([1.0, -2.0], [1.0, -2.0], ax)
    points = next(line for line in ax.get_lines() if line.get_marker() == ".")
    assert np.array_equal(points.get_xdata(), points.get_ydata())
