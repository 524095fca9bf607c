"""Numbers, inputs and parameters as prompts write them, and as an LLM would write them in a reply.

There are no more digits than needed, and what is typed back is valid.
"""

from collections.abc import Sequence
from dataclasses import replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from itertools import groupby
from math import floor, isfinite, log10

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import InputRange, Range
from falsifier.core.signals import Signal, even_times
from falsifier.core.space import Dimension
from falsifier.core.words import resolving
from falsifier.llm.prompts.view import View
from falsifier.stl.margins import is_on_limit

# Significant digits of the largest value in a column of numbers.
_COLUMN_DIGITS = 4
_BOUND_DIGITS = 10
# Digits of values that were rounded to decimals before, of which no more are left than were kept.
_ROUNDED_DIGITS = 15
# Digits of the width of a range to which values of signals and parameters are shown.
_DIGITS_OF_RANGE = 4
_DIGITS_OF_PARAMETER = 5
# Decimals that a value may have beyond these to be told as it is.
_MORE_DECIMALS = 3
# Below the one and from the other on, numbers are written with exponents, as formulas write them.
_TINY, _HUGE = 1e-4, 1e15
# Switches of a signal up to which every one is told; of others those by more than a share of the range.
_MOST_PIECES = 12
_ROUGHLY = 0.02

# Of a signal with more switches only their number and distances, and its mean are told in brief.
_MOST_IN_BRIEF = 16


def decimals_for(scale: float, digits: int = _COLUMN_DIGITS) -> int:
    """Decimals that show a number of this magnitude with that many significant digits.

    >>> decimals_for(119.6), decimals_for(0.05)
    (1, 5)
    """
    return max(0, digits - 1 - floor(log10(abs(scale)))) if isfinite(scale) and scale != 0 else 0


def column_decimals(column: NDArray[np.float64], *, margin: float | None = None) -> int:
    """Decimals needed to show a column's values and how they differ, and a margin between two of them."""
    largest, span = float(np.abs(column).max()), float(np.ptp(column))
    needed = max(decimals_for(largest), decimals_for(span, 2))
    if margin is not None and not is_on_limit(margin):
        most = max(decimals_for(largest, 9), decimals_for(span))
        needed = max(needed, min(decimals_for(margin, 3), most))
    return min(needed, decimals_for(largest, _ROUNDED_DIGITS))


def coarse_clock(stop_time: float) -> int:
    """Decimals of times that show a hundredth of the stop time, or less.

    >>> coarse_clock(50.0), coarse_clock(100.0), coarse_clock(3.0)
    (1, 1, 2)
    """
    return decimals_for(stop_time / 2, 3)


def fine_clock(view: View) -> int:
    """Decimals of times: enough for the output grid, because all times shown are sample times."""
    return max(decimals_for(view.space.stop_time, 4), decimals_for(view.experiment.output_interval, 1))


def plain(value: float, decimals: int) -> str:
    """Number with at most that many decimals, without trailing zeros; a tiny or huge one with an exponent.

    >>> plain(8.3333, 2), plain(50.0, 2), plain(-0.0001, 2), plain(0.00001063, 7), plain(2e300, 0)
    ('8.33', '50', '0', '1.06e-05', '2e+300')
    """
    if abs(value) >= _HUGE:
        return number(value, _ROUNDED_DIGITS)
    text = f"{value:.{decimals}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    rounded = float(text)
    return text if abs(rounded) >= _TINY else number(rounded, _ROUNDED_DIGITS) if rounded else "0"


def value_text(view: View, name: str, value: float, decimals: int = 6) -> str:
    """A value of a signal, with the name of its item if it has one."""
    return view.labelled(name, value, plain(value, decimals))


def bounds(low: float, high: float, digits: int = _BOUND_DIGITS) -> tuple[str, str]:
    """Bounds as text; rounded inward if rounded at all, so that a printed bound lies in the range.

    There are more digits where the range is narrow for its place: a thousandth of it is shown.

    >>> bounds(0.0, 100.0), bounds(-1.25663706143591, 1 / 3)
    (('0', '100'), ('-1.256637061', '0.3333333333'))
    """

    def rounded(value: float, rounding: str) -> str:
        kept = Context(prec=needed, rounding=rounding).create_decimal(Decimal(repr(value)))
        return number(float(kept), max(needed, _BOUND_DIGITS))

    needed = resolving(max(abs(low), abs(high)), (high - low) / 1000.0, digits)
    return rounded(low, ROUND_CEILING), rounded(high, ROUND_FLOOR)


def number(value: float, digits: int = _BOUND_DIGITS) -> str:
    """Shortest text of a number with at most that many significant digits.

    >>> number(100.0), number(0.1 + 0.2)
    ('100', '0.3')
    """
    return f"{value:.{digits}g}"


def runs(values: Sequence[float]) -> str:
    """Numbers in order, long repetitions as runs.

    >>> runs([100.0] * 4 + [0.0]), runs([0.0] * 187 + [1.0])
    ('[100, 100, 100, 100, 0]', '["0 x 187", 1]')
    """
    shortest_run = 4
    parts: list[str] = []
    for value, equal in groupby(values):
        text, length = number(value, _ROUNDED_DIGITS), len(list(equal))
        is_long = length >= shortest_run and len(values) > 3 * shortest_run
        parts += [f'"{text} x {length}"'] if is_long else [text] * length
    return f"[{', '.join(parts)}]"


def as_signals(view: View, candidate: Candidate, *, in_brief: bool = False) -> tuple[str, ...]:
    """Each input with its own control points and interpolation, inputs that do the same together; parameters.

    In brief, signals of many pieces are only described.
    """
    alike: dict[str, list[str]] = {}
    for r in view.space.inputs:
        told = _signal_text_in(r, candidate.signals[r.name], view.space.stop_time, in_brief=in_brief)
        alike.setdefault(told, []).append(r.name)
    lines = [f"{', '.join(names)}: {told}" for told, names in alike.items()]
    for p in view.space.parameters:
        value = candidate.parameters[p.name]
        if p.scale != "log":
            value = _told(value, decimals_for(p.high - p.low, _DIGITS_OF_PARAMETER))
        lines.append(f"{p.name} = {chosen(p, value, _DIGITS_OF_PARAMETER + _MORE_DECIMALS)}")
    return tuple(lines)


def chosen(ranged: Range | Dimension, value: float, digits: int, *, least: int = 0) -> str:
    """A value with decimals for so many digits of its range's width; in decades, with digits of its own."""
    if ranged.scale == "log":
        return number(value, _DIGITS_OF_PARAMETER)
    return plain(value, max(least, decimals_for(ranged.high - ranged.low, digits)))


def _told(value: float, decimals: int) -> float:
    """A value with so many decimals; as it is if it has a few more, as those of a reply may."""
    return value if round(value, decimals + _MORE_DECIMALS) == value else round(value, decimals)


def _signal_text_in(r: InputRange, signal: Signal, stop_time: float, *, in_brief: bool) -> str:
    """Parameterization with values rounded to some thousandths of the range."""
    decimals = decimals_for(r.high - r.low, _DIGITS_OF_RANGE)
    rounded = replace(signal, values=tuple(_told(v, decimals) for v in signal.values))
    if signal.interpolation == "constant" and rounded.switches > _MOST_PIECES:
        rough = _merged(rounded, _ROUGHLY * (r.high - r.low))
        if in_brief and rough.switches > _MOST_IN_BRIEF:
            return _described(rounded, rough, stop_time, decimals)
        if rough.switches < rounded.switches:
            return f"told within {_ROUGHLY:.0%} of the range: {signal_text(rough, stop_time=stop_time)}"
    return signal_text(rounded, stop_time=stop_time)


def _described(signal: Signal, merged: Signal, stop_time: float, decimals: int) -> str:
    """What is to be known of constant pieces that are not listed; those that differ little count as one."""
    low, high = (plain(v, decimals) for v in (min(signal.values), max(signal.values)))
    mean = plain(float(np.average(signal.values, weights=np.diff((*signal.times, stop_time)))), decimals)
    lengths = np.diff((*merged.times, stop_time))
    apart = [number(float(f(lengths)), 3) for f in (np.min, np.median, np.max)]
    return (
        f"{len(lengths)} constant pieces between {low} and {high}, mean {mean}, "
        f"each {apart[0]} to {apart[2]} s long, {apart[1]} s in the median"
    )


def _merged(signal: Signal, tolerance: float) -> Signal:
    """Constant pieces, those whose values differ from the first of them by no more than this as one."""
    merged = [(signal.times[0], signal.values[0])]
    for time, value in zip(signal.times[1:], signal.values[1:], strict=True):
        if abs(value - merged[-1][1]) > tolerance:
            merged.append((time, value))
    times, values = zip(*merged, strict=True)
    return replace(signal, times=times, values=values)


def signal_text(signal: Signal, *, stop_time: float) -> str:
    """Parameterization of one signal.

    >>> signal_text(Signal((0.0, 2.5), (100.0, 0.0), "constant"), stop_time=50.0)
    'constant pieces from [time, value] points [[0, 100], [2.5, 0]]'
    >>> signal_text(Signal.evenly([3.0, 3.0], stop_time=50.0), stop_time=50.0)
    'constant 3'
    """
    if len(set(signal.values)) == 1:
        return f"constant {number(signal.values[0], _ROUNDED_DIGITS)}"
    manner = "constant pieces" if signal.interpolation == "constant" else signal.interpolation
    even = even_times(len(signal.times), stop_time=stop_time, interpolation=signal.interpolation)
    if np.allclose(signal.times, even, rtol=0, atol=1e-9 * stop_time):
        return f"{manner}, {len(signal.values)} evenly spaced values {runs(signal.values)}"
    told = _merged(signal, 0.0) if signal.interpolation == "constant" else signal
    points = zip(told.times, told.values, strict=True)
    shown = ", ".join(f"[{number(t)}, {number(v, _ROUNDED_DIGITS)}]" for t, v in points)
    return f"{manner} from [time, value] points [{shown}]"
