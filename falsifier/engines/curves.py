"""Monotone cubic curves through many rows of values at once: a plan reads thousands of candidates' inputs.

``core.signals`` has the same curve for one signal, and its slopes. Importing this module imports numba.
"""

import numpy as np
from numpy.typing import NDArray

from falsifier.core.signals import end_slope, inner_slope
from falsifier.engines.box import Array
from falsifier.engines.numba_compilation import compiled

_inner_slope, _end_slope = compiled(inner_slope), compiled(end_slope)


def read_curves(knots: Array, values: Array, at: Array) -> Array:
    """Return curves through values, shape (m, k), at times between the k knots, shape (m, times)."""
    piece = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    result = np.empty((len(values), len(at)))
    _read(np.diff(knots), np.ascontiguousarray(values), piece, at - knots[piece], result)
    return result


@compiled
def _read(steps: Array, values: Array, piece: NDArray[np.intp], since: Array, result: Array) -> None:
    """Evaluate the cubic between two knots at times since the first of them."""
    secants, slopes = np.empty(len(steps)), np.empty(len(steps) + 1)
    for row in range(len(values)):
        for k in range(len(steps)):
            secants[k] = (values[row, k + 1] - values[row, k]) / steps[k]
        _find_slopes(steps, secants, slopes)
        for i in range(len(piece)):
            k, t, h = piece[i], since[i], steps[piece[i]]
            square = (3.0 * secants[k] - 2.0 * slopes[k] - slopes[k + 1]) / h
            cube = (slopes[k] + slopes[k + 1] - 2.0 * secants[k]) / (h * h)
            result[row, i] = values[row, k] + t * (slopes[k] + t * (square + t * cube))


@compiled
def _find_slopes(steps: Array, secants: Array, slopes: Array) -> None:
    """Find the slopes at the knots."""
    last = len(steps)
    if last == 1:
        slopes[0] = slopes[1] = secants[0]
        return
    slopes[0] = _end_slope(steps[0], steps[1], secants[0], secants[1])
    slopes[last] = _end_slope(steps[last - 1], steps[last - 2], secants[last - 1], secants[last - 2])
    for k in range(1, last):
        slopes[k] = _inner_slope(steps[k - 1], steps[k], secants[k - 1], secants[k])
