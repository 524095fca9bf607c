"""Signals over time in words: lists of changes, extrema, intervals, breakpoints, oscillations.

Pure functions of a time grid, shape (n,) in s, and a column, shape (n,).
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from falsifier.llm.prompts.numbers import decimals_for, plain
from falsifier.llm.prompts.shapes import Course, Points, Swing
from falsifier.stl.margins import is_on_limit

Array = NDArray[np.float64]

# Changes listed individually; of longer lists the beginning and the end.
_SHOWN_CHANGES = 16
# Decimals of times, if fewer would give two breakpoints the same time.
_FINEST_CLOCK = 6


@dataclass(frozen=True, slots=True)
class Piece:
    """An interval of constant value, from start to end in s."""

    value: float
    start: float
    end: float


def pieces(times: Array, column: Array) -> list[Piece]:
    """Intervals of constant value in order."""
    starts = [0, *(np.flatnonzero(np.diff(column)) + 1).tolist()]
    ends = [*starts[1:], len(times) - 1]
    return [
        Piece(float(column[a]), float(times[a]), float(times[b])) for a, b in zip(starts, ends, strict=True)
    ]


Label = Callable[[float, str], str]


def change_list(times: Array, column: Array, *, clock: int, label: Label = lambda _, text: text) -> str:
    """Values with the times at which they begin.

    Args:
        times: time grid in s.
        column: the signal.
        clock: decimals of times.
        label: names a value, given it and its text.

    >>> change_list(np.array([0.0, 1.0, 2.0, 3.0]), np.array([1.0, 1.0, 2.0, 2.0]), clock=2)
    '1, then 2 from 2 s'
    """
    found = pieces(times, column)
    values = [label(p.value, plain(p.value, 6)) for p in found]
    words = values[:1]
    words += [
        f"{value} from {plain(p.start, clock)} s" for value, p in zip(values[1:], found[1:], strict=True)
    ]
    if len(words) == 1:
        return f"constant {words[0]}"
    if len(words) > _SHOWN_CHANGES:
        half = _SHOWN_CHANGES // 2
        words = [*words[:half], f"{len(words) - 2 * half} more changes", *words[-half:]]
    return f"{words[0]}, then {', '.join(words[1:])}"


def dwell_list(times: Array, column: Array, *, clock: int, label: Label = lambda _, text: text) -> str:
    """How often each value was entered, and its shortest stay.

    The first interval does not count as entered, and the last one is cut off by the end of the times.
    """
    found = pieces(times, column)
    if len(found) < 2:
        return ""
    words = []
    for value in sorted({p.value for p in found}):
        again = [p for p in found[1:] if p.value == value]
        complete = [p for p in again if p is not found[-1]]
        name = label(value, plain(value, 6))
        if complete:
            shortest = min(complete, key=lambda p: p.end - p.start)
            length = plain(shortest.end - shortest.start, 3)
            begin = plain(shortest.start, clock)
            words.append(f"{name}: entered {_times(len(again))}, shortest stay {length} s from {begin} s")
        elif again:
            end = plain(float(times[-1]), clock)
            words.append(f"{name}: entered at {plain(again[0].start, clock)} s and still held at {end} s")
        else:
            words.append(f"{name}: never entered again")
    return "; ".join(words)


def longest_stretch(times: Array, wrong: NDArray[np.bool_]) -> tuple[float, float] | None:
    """Start and end in s of the longest uninterrupted interval in which this is true; None if it never is."""
    edges = np.diff(np.concatenate(([0], wrong.astype(np.int8), [0])))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    if not starts.size:
        return None
    longest = int((ends - starts).argmax())
    return float(times[starts[longest]]), float(times[ends[longest]])


def course_text(drawn: Course, *, decimals: int, clock: int) -> str:
    """Breakpoints as ``time:value``; for oscillations their envelopes and periods.

    Args:
        drawn: the signal.
        decimals: decimals of values.
        clock: decimals of times.

    >>> course_text(Course((((0.0, 1.0), (2.5, 3.0)),), (), 0.1), decimals=1, clock=1)
    '0:1 2.5:3'
    """
    parts = [(points[0][0], _pairs(points, decimals, clock)) for points in drawn.lines]
    parts += [(swing.start, _swing(swing, decimals, clock)) for swing in drawn.swings]
    return "; ".join(text for _, text in sorted(parts, key=lambda part: part[0]))


def coarse_clock(stop_time: float) -> int:
    """Decimals of times that show a hundredth of the stop time, or less.

    >>> coarse_clock(50.0), coarse_clock(100.0), coarse_clock(3.0)
    (1, 1, 2)
    """
    return decimals_for(stop_time / 2, 3)


def _are_ambiguous(points: Points, decimals: int, clock: int) -> bool:
    """Whether two breakpoints read as different values at the same time."""
    return any(
        plain(a, clock) == plain(b, clock) and plain(v, decimals) != plain(w, decimals)
        for (a, v), (b, w) in pairwise(points)
    )


def _pairs(points: Points, decimals: int, clock: int) -> str:
    while clock < _FINEST_CLOCK and _are_ambiguous(points, decimals, clock):
        clock += 1
    texts = [f"{plain(t, clock)}:{plain(v, decimals)}" for t, v in points]
    return " ".join(dict.fromkeys(texts))


def _swing(swing: Swing, decimals: int, clock: int) -> str:
    first, *later = swing.phases
    period = f"{first.period:.2g} s" + "".join(
        f", {phase.period:.2g} s from {plain(phase.start, clock)} s" for phase in later
    )
    return (
        f"oscillates from {plain(swing.start, clock)} to {plain(swing.end, clock)} s with period {period}, "
        f"between {_pairs(swing.lower, decimals, clock)} and {_pairs(swing.upper, decimals, clock)}"
    )


def column_decimals(column: Array, *, margin: float | None = None) -> int:
    """Decimals needed to show a column's values, and a margin of this size between two of them."""
    usual = decimals_for(float(np.abs(column).max()))
    if margin is None or is_on_limit(margin):
        return usual
    limit = decimals_for(float(np.abs(column).max()), 9)
    return min(max(usual, decimals_for(margin, 3)), limit)


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
