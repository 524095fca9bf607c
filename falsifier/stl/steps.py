"""The steps of a compiled formula: each fills one part of a buffer from other parts of it.

A buffer has the shape (size,) for one trajectory, or (size, m) for m at once: samples come first. Each step
is one or a few calls of numpy, which take some microseconds for thousands of samples. Sliding windows combine
windows of doubling width, so their cost grows with the logarithm of the width.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
# Changes a buffer; returns whether a checked value is not finite.
Step = Callable[[Floats], bool]
# Makes a step from the parts that it writes and reads, and two numbers. The first operand of a sliding window
# is longer than the result by the number of samples of the window after its first.
Maker = Callable[[slice, slice, slice, float, float], Step]


def run(steps: tuple[Step, ...], buffer: Floats) -> int:
    """Run all steps; return the number of the one whose check fails, after which no other is run, or -1."""
    with np.errstate(all="ignore"):  # what is not finite is found by the checks
        for number, step in enumerate(steps):
            if step(buffer):
                return number
    return -1


def _binary(function: np.ufunc) -> Maker:
    def make(out: slice, a: slice, b: slice, _p: float, _q: float) -> Step:
        def step(x: Floats) -> bool:
            function(x[a], x[b], out=x[out])
            return False

        return step

    return make


def _unary(function: np.ufunc) -> Maker:
    def make(out: slice, a: slice, _b: slice, _p: float, _q: float) -> Step:
        def step(x: Floats) -> bool:
            function(x[a], out=x[out])
            return False

        return step

    return make


def _filling(values: Callable[..., Any]) -> Maker:
    """Make steps whose values are calculated from operands, length and numbers."""

    def make(out: slice, a: slice, b: slice, p: float, q: float) -> Step:
        length = out.stop - out.start

        def step(x: Floats) -> bool:
            x[out] = values(x[a], x[b], length, p, q)
            return False

        return step

    return make


def _check(_out: slice, a: slice, _b: slice, p: float, _q: float) -> Step:
    def step(x: Floats) -> bool:
        margins = x[a]
        if not margins.all():
            margins[margins == 0.0] = p
        return not np.isfinite(margins).all()

    return step


def _window(extreme: np.ufunc) -> Maker:
    def values(a: Floats, _b: Floats, length: int, _p: float, _q: float) -> Floats:
        width = len(a) - length + 1
        if length == 1:
            return np.asarray(extreme.reduce(a, axis=0))
        covered = 1
        while 2 * covered <= width:
            a = extreme(a[:-covered], a[covered:])
            covered *= 2
        rest = width - covered
        return np.asarray(extreme(a[:length], a[rest : rest + length]))

    return _filling(values)


def _rest(extreme: np.ufunc) -> Maker:
    return _filling(lambda a, _b, _length, _p, _q: extreme.accumulate(a[::-1], axis=0)[::-1])


def _until(a: Floats, b: Floats, _length: int, _p: float, _q: float) -> Floats:
    """Return ``max(b[i], min(a[i], result[i + 1]))``, from the last sample, where it is b, to the first.

    Each sample limits what follows to an interval, and limits one after the other are an interval again:
    those of 1, 2, 4, ... samples are combined.
    """
    low, high = b.copy(), np.maximum(a, b)
    high[-1] = low[-1]
    distance = 1
    while distance < len(a):
        here, there = slice(None, -distance), slice(distance, None)
        below = np.maximum(low[here], np.minimum(high[here], low[there]))
        high[here] = np.maximum(low[here], np.minimum(high[here], high[there]))
        low[here] = below
        distance *= 2
    return low


ADD, SUBTRACT, MULTIPLY = _binary(np.add), _binary(np.subtract), _binary(np.multiply)
DIVIDE, POWER = _binary(np.divide), _binary(np.power)
MINIMUM, MAXIMUM = _binary(np.minimum), _binary(np.maximum)
ABS, SQRT, EXP, LOG = _unary(np.absolute), _unary(np.sqrt), _unary(np.exp), _unary(np.log)
SIN, COS = _unary(np.sin), _unary(np.cos)
SCALE = _filling(lambda a, _b, _length, p, q: p * a + q if q else p * a)
FILL = _filling(lambda _a, _b, _length, _p, q: q)
WINDOW_MINIMUM, WINDOW_MAXIMUM = _window(np.minimum), _window(np.maximum)
REST_MINIMUM, REST_MAXIMUM = _rest(np.minimum), _rest(np.maximum)
UNTIL = _filling(_until)
CHECK: Maker = _check  # stops unless the first operand is finite; where it is 0, it becomes the first number
