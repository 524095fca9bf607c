"""Signals over time in words: lists of changes, extrema, intervals, oscillations, sampled values.

Pure functions of a time grid, shape (n,) in s, and a column, shape (n,).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.llm.prompts.numbers import decimals_for, plain

Array = NDArray[np.float64]

# A real column with at most this many distinct values, all integers, is described by its changes.
_MAX_LEVELS = 12
# Changes listed individually; of longer lists the beginning and the end.
_SHOWN_CHANGES = 16
# Turning points closer to their neighbours than this share of the signal's span are ripple.
_RIPPLE_SHARE = 0.02
# Fewer turning points are a transient, not an oscillation.
_MIN_TURNS = 6


@dataclass(frozen=True, slots=True)
class Piece:
    """An interval of constant value, from start to end in s."""

    value: float
    start: float
    end: float


@dataclass(frozen=True, slots=True)
class Oscillation:
    """Fast oscillation of a signal.

    Attributes:
        start: in s.
        end: in s.
        period: median period in s.
        swing: median distance from one turning point to the next.
    """

    start: float
    end: float
    period: float
    swing: float


def is_discrete(column: Array, *, kind: str) -> bool:
    """Whether to describe a signal by its changes: a discrete type, or a real one with few integer values."""
    if kind != "real":
        return True
    if np.ptp(column) == 0 or not np.all(column == np.round(column)):
        return False
    return len(np.unique(column)) <= _MAX_LEVELS


def pieces(times: Array, column: Array) -> list[Piece]:
    """Intervals of constant value in order."""
    starts = [0, *(np.flatnonzero(np.diff(column)) + 1).tolist()]
    ends = [*starts[1:], len(times) - 1]
    return [
        Piece(float(column[a]), float(times[a]), float(times[b])) for a, b in zip(starts, ends, strict=True)
    ]


def change_list(times: Array, column: Array, *, clock: int) -> str:
    """Values with the times at which they begin.

    Args:
        times: time grid in s.
        column: the signal.
        clock: decimals of times.

    >>> change_list(np.array([0.0, 1.0, 2.0, 3.0]), np.array([1.0, 1.0, 2.0, 2.0]), clock=2)
    '1, then 2 from 2 s'
    """
    found = pieces(times, column)
    words = [plain(found[0].value, 6)]
    words += [f"{plain(p.value, 6)} from {plain(p.start, clock)} s" for p in found[1:]]
    if len(words) == 1:
        return f"constant {words[0]}"
    if len(words) > _SHOWN_CHANGES:
        half = _SHOWN_CHANGES // 2
        words = [*words[:half], f"{len(words) - 2 * half} more changes", *words[-half:]]
    return f"{words[0]}, then {', '.join(words[1:])}"


def dwell_list(times: Array, column: Array, *, clock: int) -> str:
    """How often each value was entered, and its shortest stay.

    The first interval does not count as entered, and the last one is cut off by the end of the simulation.
    """
    found = pieces(times, column)
    if len(found) < 2:
        return ""
    words = []
    for value in sorted({p.value for p in found}):
        again = [p for p in found[1:] if p.value == value]
        complete = [p for p in again if p is not found[-1]]
        name = plain(value, 6)
        if complete:
            shortest = min(complete, key=lambda p: p.end - p.start)
            length = plain(shortest.end - shortest.start, 3)
            begin = plain(shortest.start, clock)
            words.append(f"{name}: entered {_times(len(again))}, shortest stay {length} s from {begin} s")
        elif again:
            words.append(f"{name}: entered at {plain(again[0].start, clock)} s and kept to the end")
        else:
            words.append(f"{name}: never entered again")
    return "; ".join(words)


def extrema(times: Array, column: Array, *, decimals: int, clock: int) -> str:
    """Smallest and largest value with their times, or that the signal is constant."""
    low, high = int(column.argmin()), int(column.argmax())
    if column[low] == column[high]:
        return f"constant {plain(float(column[low]), decimals)}"
    return (
        f"min {plain(float(column[low]), decimals)} at {plain(float(times[low]), clock)} s, "
        f"max {plain(float(column[high]), decimals)} at {plain(float(times[high]), clock)} s"
    )


def longest_stretch(times: Array, wrong: NDArray[np.bool_]) -> tuple[float, float] | None:
    """Start and end in s of the longest uninterrupted interval in which this is true; None if it never is."""
    edges = np.diff(np.concatenate(([0], wrong.astype(np.int8), [0])))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    if not starts.size:
        return None
    longest = int((ends - starts).argmax())
    return float(times[starts[longest]]), float(times[ends[longest]])


def oscillation(times: Array, column: Array, *, slower_than: float) -> Oscillation | None:
    """The oscillating part of a signal that samples ``slower_than`` s apart cannot resolve, if any."""
    turns = _turning_points(column)
    if len(turns) < _MIN_TURNS:
        return None
    gaps = np.diff(times[turns])
    fast = longest_stretch(times[turns][:-1], gaps < slower_than)
    if fast is None:
        return None
    inside = [k for k in turns if fast[0] <= times[k] <= fast[1]]
    if len(inside) < _MIN_TURNS:
        return None
    return Oscillation(
        start=fast[0],
        end=fast[1],
        period=2 * float(np.median(np.diff(times[inside]))),
        swing=float(np.median(np.abs(np.diff(column[inside])))),
    )


def samples_at(times: Array, column: Array, moments: Sequence[float], *, decimals: int) -> str:
    """Values at the samples nearest to these times in s, separated by commas."""
    indices = np.interp(moments, times, np.arange(len(times))).round().astype(int)
    return ", ".join(plain(float(column[k]), decimals) for k in indices)


def column_decimals(column: Array, *, margin: float | None = None) -> int:
    """Decimals needed to show a column's values, and a margin of this size between two of them."""
    usual = decimals_for(float(np.abs(column).max()))
    if margin is None or margin == 0:
        return usual
    limit = decimals_for(float(np.abs(column).max()), 9)
    return min(max(usual, decimals_for(margin, 3)), limit)


def _turning_points(column: Array) -> list[int]:
    """Indices of extrema that differ from their neighbours by more than ripple."""
    least = _RIPPLE_SHARE * float(np.ptp(column))
    slopes = np.sign(np.diff(column))
    moving = np.flatnonzero(slopes)
    candidates = moving[1:][slopes[moving[1:]] != slopes[moving[:-1]]].tolist()
    turns: list[int] = []
    for k in candidates:
        if not turns or abs(column[k] - column[turns[-1]]) > least:
            turns.append(k)
    return turns


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
