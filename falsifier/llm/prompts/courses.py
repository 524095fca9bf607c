"""Signals over time in words: lists of changes, breakpoints within a tolerance, envelopes where they swing.

Pure functions of a time grid, shape (n,) in s, and a column, shape (n,).
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from falsifier.llm.prompts.numbers import decimals_for, plain
from falsifier.stl.margins import is_on_limit

Array = NDArray[np.float64]
# Time in s, value, and how far the value may be off.
Points = tuple[tuple[float, float, float], ...]

# Changes listed individually; of longer lists the beginning and the end.
_SHOWN_CHANGES = 16
# Decimals of times, if fewer would give two breakpoints the same time.
_FINEST_CLOCK = 6
# Breakpoints of one signal; a signal that needs more is told less exactly, and how exactly.
MOST_BREAKPOINTS = 24
_MOST_ENVELOPE_POINTS = 16
# Share of a tolerance that straight lines use up; the digits of the values have the rest.
_OF_LINES, _OF_DIGITS = 0.7, 0.6
# Factor of the period up to which an oscillation is one if breakpoints do not suffice.
_SLOWER = 4
# Oscillating intervals of one signal, the longest ones.
_MOST_SWINGS = 3
# Turning points closer to their neighbours than this share of the signal's span are ripple.
_RIPPLE_SHARE = 0.02
# or than these multiples of what is allowed, where that is less.
_OF_RIPPLE = 1.5
# Fewer turning points are a transient, not an oscillation.
_MIN_TURNS = 6
# Above every distance in multiples of what is allowed, which is no less than a thousandth of a span.
_URGENT = 1e6
# A period that changes by more than this factor is told at the beginning and at the end.
_PERIOD_FACTOR = 1.5


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


@dataclass(frozen=True, slots=True)
class Swing:
    """An interval in which a signal oscillates too fast for single points.

    Attributes:
        start: in s.
        end: in s.
        periods: in s, at the beginning and at the end.
        lower: breakpoints of the envelope below.
        upper: breakpoints of the envelope above.
    """

    start: float
    end: float
    periods: tuple[float, float]
    lower: Points
    upper: Points

    def beyond(self, times: Array, column: Array) -> Array:
        """How far a signal is outside of the envelopes within the interval, 0 elsewhere; shape (n,)."""
        low, high = (np.interp(times, *np.array(side).T[:2]) for side in (self.lower, self.upper))
        inside = (times >= self.start) & (times <= self.end)
        return np.asarray(np.where(inside, np.maximum(np.maximum(low - column, column - high), 0.0), 0.0))


@dataclass(frozen=True, slots=True)
class Course:
    """A signal over time: breakpoints, joined by straight lines, in each part that does not oscillate.

    Attributes:
        lines: the parts between oscillations.
        swings: the parts that oscillate.
        error: largest distance between what is told and the signal.
        excess: the same in multiples of what was wanted there; at most 1 if the points suffice.
        claimed: distance up to which nothing is said of it.
    """

    lines: tuple[Points, ...]
    swings: tuple[Swing, ...]
    error: float
    excess: float
    claimed: float

    def text(self, *, clock: int) -> str:
        """Breakpoints as ``time:value``, envelopes and periods; what is less exact than claimed says so.

        Args:
            clock: decimals of times.

        >>> Course((((0.0, 1.0, 0.1), (2.5, 3.0, 0.1)),), (), 0.0, 0.0, 0.1).text(clock=1)
        '0:1 2.5:3'
        """
        parts = [(points[0][0], _pairs(points, clock)) for points in self.lines]
        parts += [(swing.start, _swing_text(swing, clock)) for swing in self.swings]
        told = "; ".join(text for _, text in sorted(parts, key=lambda part: part[0]))
        if self.error <= self.claimed:
            return told
        return f"{told} (each value within {_upwards(self.error)})"


def course(
    times: Array,
    column: Array,
    *,
    tolerance: Array | float,
    slower_than: float,
    claimed: float | None = None,
    kept: Iterable[float] = (),
    most: int = MOST_BREAKPOINTS,
) -> Course:
    """Redraw a signal.

    Args:
        times: time grid in s.
        column: the signal.
        tolerance: distance from the signal that is wanted, in its own unit; one number or one per time.
        claimed: distance that the reader is told in general; default: the largest that is wanted.
        slower_than: oscillations with at least this period in s are told point by point, if points suffice.
        kept: times in s at which a breakpoint is wanted in any case.
        most: maximum number of other breakpoints.
    """
    allowed = np.broadcast_to(np.asarray(tolerance, dtype=np.float64), times.shape)
    kept, claimed = tuple(kept), float(allowed.max()) if claimed is None else claimed
    drawn = _drawn(times, column, allowed, claimed, (), kept, most)
    for slowest in (slower_than, _SLOWER * slower_than):
        if drawn.excess <= 1 or slowest <= 0:
            break
        found = oscillations(times, column, slower_than=slowest, tolerance=allowed)
        longest = sorted(found, key=lambda s: s.start - s.end)[:_MOST_SWINGS]
        if longest:
            ordered = sorted(longest, key=lambda s: s.start)
            swinging = _drawn(times, column, allowed, claimed, ordered, kept, most)
            drawn = min(drawn, swinging, key=lambda one: one.excess)
    return drawn


def _drawn(
    times: Array,
    column: Array,
    allowed: Array,
    claimed: float,
    swings: Iterable[Swing],
    kept: tuple[float, ...],
    most: int,
) -> Course:
    """Redraw a signal with these oscillations, and breakpoints between them."""
    swings = tuple(swings)
    spans = [(_index(times, s.start), _index(times, s.end)) for s in swings]
    begins, ends = [0, *(b for _, b in spans)], [*(a for a, _ in spans), len(times) - 1]
    gaps = [(a, b) for a, b in zip(begins, ends, strict=True) if b > a]
    error = np.zeros_like(times)
    lines = []
    for begin, end in gaps:
        part = slice(begin, end + 1)
        inside = [_index(times[part], t) for t in kept if times[begin] <= t <= times[end]]
        chosen = breakpoints(
            times[part],
            column[part],
            tolerance=_OF_LINES * allowed[part],
            first=_OF_LINES * claimed,
            most=max(2, most // len(gaps)),
            kept=inside,
        )
        error[part] = np.abs(np.interp(times[part], times[part][chosen], column[part][chosen]) - column[part])
        lines.append(_points(times[part], column[part], allowed[part], chosen))
    for swing in swings:
        error = np.maximum(error, swing.beyond(times, column))
    # A breakpoint where nothing may be off stands for itself.
    excess = error / np.where(allowed > 0, allowed, np.inf) / _OF_LINES
    return Course(tuple(lines), swings, float(error.max()) / _OF_LINES, float(excess.max()), claimed)


def breakpoints(
    times: Array,
    column: Array,
    *,
    tolerance: Array | float,
    first: float = np.inf,
    most: int = MOST_BREAKPOINTS,
    kept: Iterable[int] = (),
) -> list[int]:
    """Choose points such that straight lines between them redraw a column.

    Ramer-Douglas-Peucker with distances along the value axis, as multiples of what is allowed; the worst
    segment is divided first, so that a limited number of points goes where it is needed most.

    Args:
        times: time grid in s.
        column: the signal.
        tolerance: distance that is allowed; one number or one per time.
        first: distance that is allowed anywhere; segments that exceed it are divided before all others.
        most: maximum number of points in addition to those kept.
        kept: indices to choose in any case.

    Returns:
        Indices in order.
    """
    allowed = np.maximum(np.broadcast_to(tolerance, times.shape), np.finfo(np.float64).tiny)
    chosen = sorted({0, *kept, len(times) - 1})
    heap = [_worst(times, column, allowed, first, a, b) for a, b in pairwise(chosen)]
    heapify(heap)
    limit = len(chosen) + most - 2
    while heap and -heap[0][0] > 1 and len(chosen) < limit:
        _, a, k, b = heappop(heap)
        chosen.append(k)
        for begin, end in ((a, k), (k, b)):
            heappush(heap, _worst(times, column, allowed, first, begin, end))
    return sorted(chosen)


def oscillations(
    times: Array, column: Array, *, slower_than: float, tolerance: Array | float | None = None
) -> list[Swing]:
    """Intervals in which a signal has at least six turning points, each pair closer than half a period.

    Args:
        times: time grid in s.
        column: the signal.
        slower_than: period in s from which a movement is no oscillation in this sense.
        tolerance: allowed distance of the signal; default: a fiftieth of its span.
    """
    usual = _RIPPLE_SHARE * float(np.ptp(column))
    allowed = np.broadcast_to(
        np.asarray(usual if tolerance is None else tolerance, dtype=np.float64), times.shape
    )
    turns = turning_points(column, np.minimum(usual, _OF_RIPPLE * allowed))
    if len(turns) < _MIN_TURNS:
        return []
    fast = np.diff(times[turns]) < slower_than / 2
    return [
        _swing(times, column, turns[a : b + 1], allowed) for a, b in _runs(fast) if b + 1 - a >= _MIN_TURNS
    ]


def turning_points(column: Array, ripple: Array) -> list[int]:
    """Indices of highs and lows in turn that differ from their neighbours by more than this, one per time."""
    slopes = np.sign(np.diff(column))
    moving = np.flatnonzero(slopes)
    candidates = moving[1:][slopes[moving[1:]] != slopes[moving[:-1]]].tolist()
    turns: list[int] = []
    for k in candidates:
        if len(turns) > 1 and (column[k] - column[turns[-1]]) * (column[turns[-1]] - column[turns[-2]]) > 0:
            turns[-1] = k
        elif not turns or abs(column[k] - column[turns[-1]]) > ripple[k]:
            turns.append(k)
    return turns


def _swing(times: Array, column: Array, turns: list[int], allowed: Array) -> Swing:
    rising = [column[b] > column[a] for a, b in pairwise(turns)]
    high = [k for k, up in zip(turns[1:], rising, strict=True) if up]
    low = [k for k, up in zip(turns[1:], rising, strict=True) if not up]
    (low if rising[0] else high).insert(0, turns[0])
    periods = 2 * np.diff(times[turns])
    return Swing(
        float(times[turns[0]]),
        float(times[turns[-1]]),
        (float(np.median(periods[:_MIN_TURNS])), float(np.median(periods[-_MIN_TURNS:]))),
        _envelope(times, column, low, allowed),
        _envelope(times, column, high, allowed),
    )


def _envelope(times: Array, column: Array, extrema: list[int], allowed: Array) -> Points:
    at, values = times[extrema], column[extrema]
    # A peak between two samples is cut off; envelopes differ by what a signal changes there in one step.
    inner = np.clip(extrema, 1, len(column) - 2)
    sides = np.maximum(np.abs(column[inner] - column[inner - 1]), np.abs(column[inner] - column[inner + 1]))
    wanted = np.maximum(_OF_LINES * allowed[extrema], float(np.median(sides)))
    chosen = breakpoints(at, values, tolerance=wanted, most=_MOST_ENVELOPE_POINTS)
    return _points(at, values, allowed[extrema], chosen)


def _runs(flags: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First index and index after the last of each run of true flags."""
    edges = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    yield from zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True)


def _worst(
    times: Array, column: Array, allowed: Array, first: float, a: int, b: int
) -> tuple[float, int, int, int]:
    """Where a line between two points is off most: negative urgency, the points' indices and that place."""
    if b - a < 2:
        return 0.0, a, a, b
    inner = slice(a + 1, b)
    line = column[a] + (column[b] - column[a]) * (times[inner] - times[a]) / (times[b] - times[a])
    off = np.abs(column[inner] - line)
    if off[k := int(off.argmax())] > first:
        return -_URGENT * float(off[k] / first), a, a + 1 + k, b
    k = int((off / allowed[inner]).argmax())
    return -float(off[k] / allowed[inner][k]), a, a + 1 + k, b


def _points(times: Array, column: Array, allowed: Array, chosen: Iterable[int]) -> Points:
    return tuple((float(times[k]), float(column[k]), float(allowed[k])) for k in chosen)


def _index(times: Array, time: float) -> int:
    return int(np.abs(times - time).argmin())


def coarse_clock(stop_time: float) -> int:
    """Decimals of times that show a hundredth of the stop time, or less.

    >>> coarse_clock(50.0), coarse_clock(100.0), coarse_clock(3.0)
    (1, 1, 2)
    """
    return decimals_for(stop_time / 2, 3)


def _are_ambiguous(points: Points, clock: int) -> bool:
    """Whether two breakpoints read as different values at the same time."""
    return any(
        plain(a, clock) == plain(b, clock) and _value(v, u) != _value(w, x)
        for (a, v, u), (b, w, x) in pairwise(points)
    )


def _pairs(points: Points, clock: int) -> str:
    while clock < _FINEST_CLOCK and _are_ambiguous(points, clock):
        clock += 1
    return " ".join(dict.fromkeys(f"{plain(t, clock)}:{_value(v, allowed)}" for t, v, allowed in points))


def _value(value: float, allowed: float) -> str:
    """A value with the digits that what it may be off by leaves."""
    return plain(value, decimals_for(_OF_DIGITS * allowed, 1)) if allowed else f"{value:.9g}"


def _upwards(error: float) -> str:
    """An error with two digits, not less than it is."""
    decimals = decimals_for(error, 2)
    return plain(error + 0.5 * 10.0**-decimals, decimals)


def _swing_text(swing: Swing, clock: int) -> str:
    first, last = swing.periods
    changes = max(first, last) > _PERIOD_FACTOR * min(first, last)
    period = f"{first:.2g} s, at the end {last:.2g} s" if changes else f"{first:.2g} s"
    return (
        f"oscillates from {plain(swing.start, clock)} to {plain(swing.end, clock)} s with period {period}, "
        f"between {_pairs(swing.lower, clock)} and {_pairs(swing.upper, clock)}"
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
