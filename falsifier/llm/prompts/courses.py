"""Signals over time in words: lists of changes, breakpoints within a tolerance, envelopes where they swing.

Pure functions of a time grid, shape (n,) in s, and a column, shape (n,).
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from heapq import heapify, heappop, heappush
from itertools import pairwise, zip_longest
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from falsifier.core.words import resolving
from falsifier.llm.prompts.numbers import decimals_for, number, plain

Array = NDArray[np.float64]
# Time in s, value, and how far the value may be off.
Points = tuple[tuple[float, float, float], ...]

# Changes listed individually; of longer lists the beginning and the end.
SHOWN_CHANGES = 24
# Stays are equal up to this share of them.
_EQUAL_STAYS = 1e-6
# A signal jumps where it changes in one step by this share of its span, and so many times as much as in the
# steps beside that.
_JUMP, _ALONE = 0.03, 4.0
# So many changes by the same amount, after the same time, are told together.
_REGULAR = 4
# Breakpoints of one signal; a signal that needs more is told less exactly, and how exactly.
MOST_BREAKPOINTS = 40
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
# Share of periods that differ from the one before by more than that, up to which a swing is regular.
_UNEVEN = 0.25

Label = Callable[[float, str], str]


def change_list(times: Array, column: Array, *, clock: int, label: Label = lambda _, text: text) -> str:
    """Values with the times at which they begin.

    ``clock`` is the number of decimals of times; ``label`` names a value, given it and its text.

    >>> change_list(np.array([0.0, 1.0, 2.0, 3.0]), np.array([1.0, 1.0, 2.0, 2.0]), clock=2)
    '1, then 2 from 2 s'
    """
    first, *rest = _pieces(times, column)
    begin = label(first[0], plain(first[0], 6))
    if not rest:
        return f"constant {begin}"
    changes = list(_changes([(value, start) for value, start, _ in rest], clock, label))
    half = SHOWN_CHANGES // 2
    if len(changes) > SHOWN_CHANGES:
        hidden = sum(count for _, count in changes[half - 1 : -half])
        changes = [*changes[: half - 1], (f"{hidden} more changes", hidden), *changes[-half:]]
    return f"{begin}, then {', '.join(text for text, _ in changes)}"


def _changes(begun: Sequence[tuple[float, float]], clock: int, label: Label) -> Iterator[tuple[str, int]]:
    """Values and the times in s at which they begin, in words, with their number; regular ones together."""
    steps: Array = np.diff(np.array(begun), axis=0)
    alike = np.asarray(np.isclose(steps[1:], steps[:-1], rtol=1e-6, atol=0).all(axis=1))
    k = 0
    while k < len(begun):
        value, start = begun[k]
        yield f"{label(value, plain(value, 6))} from {plain(start, clock)} s", 1
        count = 0
        while k + count < len(steps) and (count == 0 or alike[k + count - 1]):
            count += 1
        if count >= _REGULAR:
            (by, every), (last, end) = steps[k].tolist(), begun[k + count]
            then = label(last, plain(last, 6))
            yield f"by {by:+.6g} every {number(every, 6)} s to {then} from {plain(end, clock)} s", count
            k += count
        k += 1


def dwell_list(times: Array, column: Array, *, clock: int, label: Label = lambda _, text: text) -> str:
    """The shortest stay at each value at which the signal stayed more than once, or that all were equal.

    The last stay is cut off by the end of the times.
    """
    found = _pieces(times, column)
    words = []
    for value in sorted({value for value, _, _ in found}):
        stays = [(end - start, start) for v, start, end in found[:-1] if v == value]
        count = len(stays) + (found[-1][0] == value)
        if count > 1:
            length, start = min(stays)
            told = f"the shortest for {number(length, 6)} s from {plain(start, clock)} s"
            if len(stays) > 1 and max(stays)[0] - length < _EQUAL_STAYS * length:
                told = f"each for {number(length, 6)} s"
                told += ", the last one to the end" * (len(stays) < count)
            words.append(f"{count} times at {label(value, plain(value, 6))}, {told}")
    return "; ".join(words)


def _pieces(times: Array, column: Array) -> list[tuple[float, float, float]]:
    """Intervals of constant value in order: the value, start and end in s."""
    starts = [0, *(np.flatnonzero(np.diff(column)) + 1).tolist()]
    ends = [*starts[1:], len(times) - 1]
    return [(float(column[a]), float(times[a]), float(times[b])) for a, b in zip(starts, ends, strict=True)]


def jumps(column: Array) -> NDArray[np.intp]:
    """Indices at which a signal changes in one step, by much more than in the steps before and after.

    >>> jumps(np.array([0.0, 0.1, 2.0, 2.1, 2.2])).tolist()
    [2]
    """
    size = np.abs(np.diff(column))
    beside = np.maximum(np.append(size[1:], 0.0), np.insert(size[:-1], 0, 0.0))
    return np.flatnonzero((size >= _JUMP * np.ptp(column)) & (size > _ALONE * beside)) + 1


def longest_stretch(times: Array, wrong: NDArray[np.bool_]) -> tuple[float, float] | None:
    """Start and end in s of the longest uninterrupted interval in which this is true; None if it never is."""
    begin, end = max(_runs(wrong), key=lambda run: run[1] - run[0], default=(0, 0))
    return (float(times[begin]), float(times[end - 1])) if end else None


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First index and index after the last of each run of true flags."""
    edges = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    starts, ends = np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist()
    return list(zip(starts, ends, strict=True))


class Swing(NamedTuple):
    """An interval in s in which a signal oscillates too fast for single points, between two envelopes."""

    start: float
    end: float
    periods: tuple[float, float]  # in s, at the beginning and at the end
    is_regular: bool  # whether most periods are about as long as the one before
    lower: Points
    upper: Points

    def beyond(self, times: Array, column: Array) -> Array:
        """How far a signal is outside of the envelopes within the interval, 0 elsewhere; shape (n,)."""
        low, high = (np.interp(times, *np.array(side).T[:2]) for side in (self.lower, self.upper))
        inside = (times >= self.start) & (times <= self.end)
        return np.asarray(np.where(inside, np.maximum(np.maximum(low - column, column - high), 0.0), 0.0))

    def text(self, clock: int) -> str:
        """Interval, period and envelopes in words, times with so many decimals."""
        first, last = self.periods
        changes = max(first, last) > _PERIOD_FACTOR * min(first, last)
        begin, end = (plain(p, decimals_for(p, 2)) for p in self.periods)
        period = f"{begin} s, at the end {end} s" if changes else f"{begin} s"
        how = f" with period {period}" if self.is_regular else ", not regularly"
        return (
            f"swings from {plain(self.start, clock)} to {plain(self.end, clock)} s{how}, "
            f"between {_pairs(self.lower, clock)} and {_pairs(self.upper, clock)}"
        )


def course(
    times: Array,
    column: Array,
    *,
    clock: int,
    tolerance: Array | float,
    slower_than: float,
    claimed: float | None = None,
    kept: Iterable[float] = (),
    most: int = MOST_BREAKPOINTS,
    coarsest: float = 1.0,
) -> str:
    """Return breakpoints as ``time:value``, joined by straight lines, and envelopes and periods between them.

    ``clock`` is the number of decimals of times, ``tolerance`` the distance from the signal that is wanted,
    in its own unit, one number or one per time. Oscillations with at least the period ``slower_than`` are
    told point by point, if points suffice. What is less exact than ``claimed``, by default the largest
    distance that is wanted, says so; beyond the share ``coarsest`` of the span, values at some times and the
    extremes are told. ``most`` limits the breakpoints beside those at the times ``kept``.
    """
    allowed = np.broadcast_to(np.asarray(tolerance, dtype=np.float64), times.shape)
    kept, claimed = tuple(kept), float(allowed.max()) if claimed is None else claimed

    def drawn(swings: list[Swing]) -> tuple[float, float, str]:
        """The error in multiples of what is wanted, the error, and the text; breakpoints between swings."""
        edges = [0, *(_index(times, t) for s in swings for t in (s.start, s.end)), len(times) - 1]
        gaps = list(zip(edges[::2], edges[1::2], strict=True))
        error, told = np.zeros_like(times), []
        for (begin, end), swing in zip_longest(gaps, swings):
            if end > begin:
                part = slice(begin, end + 1)
                chosen = breakpoints(
                    times[part],
                    column[part],
                    tolerance=_OF_LINES * allowed[part],
                    first=_OF_LINES * claimed,
                    most=max(2, most // sum(b > a for a, b in gaps)),
                    kept=[_index(times[part], t) for t in kept if times[begin] <= t <= times[end]],
                )
                points = _points(times[part], column[part], allowed[part], chosen)
                error[part] = np.abs(np.interp(times[part], *np.array(points).T[:2]) - column[part])
                told.append(_pairs(points, clock))
            if swing is not None:
                error = np.maximum(error, swing.beyond(times, column))
                told.append(swing.text(clock))
        # A breakpoint where nothing may be off stands for itself.
        excess = error / np.where(allowed > 0, allowed, np.inf)
        return float(excess.max()) / _OF_LINES, float(error.max()) / _OF_LINES, "; ".join(told)

    best = drawn([])
    for slowest in (slower_than, _SLOWER * slower_than):
        if best[0] <= 1 or slowest <= 0:
            break
        found = oscillations(times, column, slower_than=slowest, tolerance=allowed)
        if found:
            longest = sorted(found, key=lambda s: s.start - s.end)[:_MOST_SWINGS]
            best = min(best, drawn(sorted(longest)), key=lambda one: one[0])
    _, off, text = best
    if off <= claimed:
        return text
    decimals = decimals_for(off, 2)
    # Rounded up: it is not less than it is told to be.
    within = f"each value within {plain(off + 0.5 * 10.0**-decimals, decimals)}"
    ends = [(word, int(at)) for word, at in (("least", column.argmin()), ("greatest", column.argmax()))]
    extremes = ", ".join(
        f"{word} {number(column[k], resolving(column[k], off / 100, 5))} at {plain(times[k], clock)} s"
        for word, k in ends
    )
    if off > coarsest * float(np.ptp(column)):
        edges = np.unique(np.linspace(0, len(times) - 1, most + 1).round().astype(int)).tolist()
        spans = (column[a : b + 1] for a, b in pairwise(edges))
        digits = decimals_for(float(np.ptp(column)), 3)
        told = (f"{plain(part.min(), digits)} to {plain(part.max(), digits)}" for part in spans)
        length = number((times[-1] - times[0]) / (len(edges) - 1), 2)
        return f"irregular, least to greatest in each {length} s: {', '.join(told)} ({extremes})"
    return f"{text} ({within}; {extremes})"


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

    ``tolerance`` is the distance that is allowed, one number or one per time; segments that exceed the one
    ``first`` are divided before all others. ``most`` is the maximum number of points beside the indices
    ``kept``, which are chosen in any case. Returns indices in order.
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

    From the period ``slower_than`` in s on, a movement is none. The ``tolerance`` is the allowed distance of
    the signal; default: a fiftieth of its span.
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
    periods = times[turns[2:]] - times[turns[:-2]]  # rises and falls may differ
    uneven = np.abs(np.diff(np.log(periods))) > np.log(_PERIOD_FACTOR)
    return Swing(
        float(times[turns[0]]),
        float(times[turns[-1]]),
        (float(np.median(periods[:_MIN_TURNS])), float(np.median(periods[-_MIN_TURNS:]))),
        bool(uneven.mean() <= _UNEVEN),
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


def _pairs(points: Points, clock: int) -> str:
    """Points as ``time:value``; no two that read as different values have the same time."""
    values = [  # with the digits that what they may be off by leaves
        plain(value, decimals_for(_OF_DIGITS * allowed, 1)) if allowed else f"{value:.9g}"
        for _, value, allowed in points
    ]
    while True:
        told = list(zip((plain(time, clock) for time, _, _ in points), values, strict=True))
        if not any(a[0] == b[0] and a[1] != b[1] for a, b in pairwise(told)):
            return " ".join(dict.fromkeys(f"{time}:{value}" for time, value in told))
        clock += 1
