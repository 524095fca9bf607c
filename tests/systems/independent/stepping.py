"""Classical Runge-Kutta over many runs at once, with inputs held over the pieces of a grid."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def runge_kutta(slope: Callable[[Array], Array], state: Array, duration: float, steps: int) -> Array:
    """State after a number of fourth-order steps of an autonomous system.

    Args:
        slope: derivative of a state, shape (states, runs).
        state: start, same shape.
        duration: time covered in s.
        steps: number of equal steps.
    """
    h = duration / steps
    for _ in range(steps):
        k1 = slope(state)
        k2 = slope(state + h / 2 * k1)
        k3 = slope(state + h / 2 * k2)
        k4 = slope(state + h * k3)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return state
