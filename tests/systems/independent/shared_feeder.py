"""Two charge points on one feeder, tick by tick: who knows what of the other, and how hot the cable gets."""

import numpy as np

from tests.systems.independent.stepping import Array

PERIOD, LIMIT, WARMING = 0.1, 100.0, 2.0


def loads(left: Array, right: Array, *, start_right: int = 10) -> tuple[Array, Array]:
    """Return both currents at all ticks, for requests in A at these ticks.

    A request acts one tick later. The left one steps first: of the right one it knows the current two ticks
    ago; the right one knows that of one tick ago.
    """
    a, b = np.zeros(len(left)), np.zeros(len(right))
    a[0] = left[0]
    for k in range(1, len(left)):
        a[k] = min(left[k - 1], LIMIT - (b[k - 2] if k > 1 else 0.0))
        b[k] = min(right[k - 1], LIMIT - a[k - 1]) if k >= start_right else 0.0
    return a, b


def heat(load: Array) -> Array:
    """Return the temperature rise at all ticks; the feeder gets the load at the end of each step."""
    rise, decay = np.full(len(load), 0.5), float(np.exp(-PERIOD / WARMING))
    for k in range(1, len(load)):
        settled = (load[k] / LIMIT) ** 2
        rise[k] = settled + (rise[k - 1] - settled) * decay
    return rise
