"""What is drawn, and reading it off."""

import numpy as np
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from falsifier import Evaluation, evaluate, falsify
from tests.problems import hard


def simulated() -> Evaluation:
    """A simulation of the problem ``hard`` at one of its corners."""
    return evaluate(hard(), falsify(hard(), "corners", budget=1).evaluations[0].candidate)


def xs(line: Line2D) -> NDArray[np.float64]:
    """Where a line's points lie across."""
    return np.asarray(line.get_xdata(), dtype=np.float64)


def ys(line: Line2D) -> NDArray[np.float64]:
    """Where a line's points lie upwards."""
    return np.asarray(line.get_ydata(), dtype=np.float64)
