"""Numbers as prompts write them: no more digits than needed, and bounds that are valid if typed back."""

from collections.abc import Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from math import floor, isfinite, log10

import numpy as np
from numpy.typing import NDArray

from falsifier.stl.margins import is_on_limit

# Significant digits of the largest value in a column of numbers.
_COLUMN_DIGITS = 4
_BOUND_DIGITS = 10
_CHOSEN_DIGITS = 7


def decimals_for(scale: float, digits: int = _COLUMN_DIGITS) -> int:
    """Decimals that show a number of this magnitude with that many significant digits.

    >>> decimals_for(119.6), decimals_for(0.05)
    (1, 5)
    """
    if not isfinite(scale) or scale == 0:
        return 0
    return max(0, digits - 1 - floor(log10(abs(scale))))


def column_decimals(column: NDArray[np.float64], *, margin: float | None = None) -> int:
    """Decimals needed to show a column's values, and a margin of this size between two of them."""
    usual = decimals_for(float(np.abs(column).max()))
    if margin is None or is_on_limit(margin):
        return usual
    limit = decimals_for(float(np.abs(column).max()), 9)
    return min(max(usual, decimals_for(margin, 3)), limit)


def coarse_clock(stop_time: float) -> int:
    """Decimals of times that show a hundredth of the stop time, or less.

    >>> coarse_clock(50.0), coarse_clock(100.0), coarse_clock(3.0)
    (1, 1, 2)
    """
    return decimals_for(stop_time / 2, 3)


def plain(value: float, decimals: int) -> str:
    """Number with at most that many decimals, without trailing zeros.

    >>> plain(8.3333, 2), plain(50.0, 2), plain(-0.0001, 2)
    ('8.33', '50', '0')
    """
    text = f"{value:.{decimals}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def bounds(low: float, high: float, digits: int = _BOUND_DIGITS) -> tuple[str, str]:
    """Bounds as text; rounded inward if rounded at all, so that a printed bound lies in the range.

    >>> bounds(0.0, 100.0), bounds(-1.25663706143591, 1 / 3)
    (('0', '100'), ('-1.256637061', '0.3333333333'))
    """

    def rounded(value: float, rounding: str) -> str:
        return number(float(Context(prec=digits, rounding=rounding).create_decimal(Decimal(repr(value)))))

    return rounded(low, ROUND_CEILING), rounded(high, ROUND_FLOOR)


def number(value: float, digits: int = _BOUND_DIGITS) -> str:
    """Shortest text of a number with at most that many significant digits.

    >>> number(100.0), number(0.1 + 0.2)
    ('100', '0.3')
    """
    return f"{value:.{digits}g}"


def runs(values: Sequence[float]) -> str:
    """Numbers in order, long repetitions as runs.

    >>> runs([100.0, 100.0, 0.0]), runs([0.0] * 187 + [1.0])
    ('[100, 100, 0]', '["0 x 187", 1]')
    """
    shortest_run = 4
    parts: list[str] = []
    start = 0
    while start < len(values):
        end = start
        while end < len(values) and values[end] == values[start]:
            end += 1
        text = number(values[start], _CHOSEN_DIGITS)
        length = end - start
        is_long = length >= shortest_run and len(values) > 3 * shortest_run
        parts += [f'"{text} x {length}"'] if is_long else [text] * length
        start = end
    return f"[{', '.join(parts)}]"
