"""What is needed to redraw a signal: breakpoints within a tolerance, envelopes and periods where it swings.

Pure functions of a time grid, shape (n,) in s, and a column, shape (n,).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Points = tuple[tuple[float, float], ...]

# Breakpoints of one signal; a signal that needs more is told less exactly.
MOST_BREAKPOINTS = 24
_MOST_ENVELOPE_POINTS = 16
# Factor of the period up to which an oscillation is one if breakpoints do not suffice.
_SLOWER = 4
# Oscillating intervals of one signal, the longest ones.
_MOST_SWINGS = 3
# Parts between them that are shorter than this share of the simulation are left out.
_SHORT_SHARE = 0.02
# An envelope is told less exactly than a signal, in multiples of the signal's tolerance.
_ENVELOPE_TOLERANCE = 1.5
# Turning points closer to their neighbours than this share of the signal's span are ripple.
_RIPPLE_SHARE = 0.02
# Fewer turning points are a transient, not an oscillation.
_MIN_TURNS = 6
# A new phase begins if the period differs by more than this factor from that of the phase so far.
_PERIOD_FACTOR = 1.5
# Turning points of the shortest phase.
_MIN_PHASE = 12


@dataclass(frozen=True, slots=True)
class Phase:
    """Part of an oscillation with one period; start and period in s."""

    start: float
    period: float


@dataclass(frozen=True, slots=True)
class Swing:
    """An interval in which a signal oscillates too fast for single points.

    Attributes:
        start: in s.
        end: in s.
        phases: periods in order.
        lower: breakpoints of the envelope below, as (time in s, value).
        upper: breakpoints of the envelope above.
    """

    start: float
    end: float
    phases: tuple[Phase, ...]
    lower: Points
    upper: Points

    def period_at(self, time: float) -> float:
        """Period in s at this time."""
        begun = [p.period for p in self.phases if p.start <= time]
        return begun[-1] if begun else self.phases[0].period


@dataclass(frozen=True, slots=True)
class Course:
    """A signal over time: breakpoints, joined by straight lines, in each part that does not oscillate.

    Attributes:
        lines: the parts between oscillations, as (time in s, value) breakpoints.
        swings: the parts that oscillate.
        tolerance: largest distance between the lines and the signal.
    """

    lines: tuple[Points, ...]
    swings: tuple[Swing, ...]
    tolerance: float


def course(
    times: Array,
    column: Array,
    *,
    tolerance: float,
    slower_than: float,
    kept: Iterable[float] = (),
    most: int = MOST_BREAKPOINTS,
) -> Course:
    """Redraw a signal.

    Args:
        times: time grid in s.
        column: the signal.
        tolerance: distance from the signal that is allowed, in its own unit.
        slower_than: oscillations with at least this period in s are told point by point, if points suffice.
        kept: times in s at which a breakpoint is wanted in any case.
        most: maximum number of other breakpoints.
    """
    whole, error = _breakpoints(times, column, tolerance, kept, most=most)
    if error <= tolerance:
        return Course((_points(times, column, whole),), (), error)
    kept = tuple(kept)
    fast = _with_swings(times, column, tolerance, slower_than, kept, most)
    if fast.swings and fast.tolerance <= tolerance:
        return fast
    slow = _with_swings(times, column, tolerance, _SLOWER * slower_than, kept, most)
    return min(fast, slow, key=lambda drawn: drawn.tolerance)


def _with_swings(
    times: Array, column: Array, tolerance: float, slower_than: float, kept: tuple[float, ...], most: int
) -> Course:
    """Redraw a signal with its longest oscillations, and breakpoints between them."""
    found = oscillations(times, column, slower_than=slower_than, tolerance=tolerance)
    longest = sorted(found, key=lambda s: s.start - s.end)[:_MOST_SWINGS]
    swings = sorted(longest, key=lambda s: s.start)
    spans = [(_index(times, s.start), _index(times, s.end)) for s in swings]
    gaps = [
        (begin, end)
        for begin, end in zip(
            [0, *(b for _, b in spans)], [*(a for a, _ in spans), len(times) - 1], strict=True
        )
        if end - begin > _SHORT_SHARE * len(times)
    ]
    lines, worst = [], 0.0
    for begin, end in gaps:
        part = slice(begin, end + 1)
        chosen, error = _breakpoints(
            times[part], column[part], tolerance, kept, most=max(2, most // len(gaps))
        )
        worst = max(worst, error)
        lines.append(_points(times[part], column[part], chosen))
    return Course(tuple(lines), tuple(swings), worst)


def breakpoints(
    times: Array, column: Array, *, tolerance: float, most: int = MOST_BREAKPOINTS, kept: Iterable[int] = ()
) -> tuple[list[int], float]:
    """Choose points such that straight lines between them redraw a column.

    Ramer-Douglas-Peucker with distances along the value axis; the worst segment is divided first, so that a
    limited number of points goes where it is needed most.

    Args:
        times: time grid in s.
        column: the signal.
        tolerance: distance that is allowed.
        most: maximum number of points in addition to those kept.
        kept: indices to choose in any case.

    Returns:
        Indices in order, and the largest distance that remains.
    """
    chosen = sorted({0, *kept, len(times) - 1})
    heap = [_worst(times, column, a, b) for a, b in pairwise(chosen)]
    heapify(heap)
    limit = len(chosen) + most - 2
    while heap and -heap[0][0] > tolerance and len(chosen) < limit:
        _, a, k, b = heappop(heap)
        chosen.append(k)
        for piece in (_worst(times, column, a, k), _worst(times, column, k, b)):
            heappush(heap, piece)
    return sorted(chosen), -heap[0][0] if heap else 0.0


def oscillations(
    times: Array, column: Array, *, slower_than: float, tolerance: float | None = None
) -> list[Swing]:
    """Intervals in which a signal has at least six turning points, each pair closer than half a period.

    Args:
        times: time grid in s.
        column: the signal.
        slower_than: period in s from which a movement is no oscillation in this sense.
        tolerance: allowed distance of the signal; default: a fiftieth of its span.
    """
    turns = turning_points(column)
    if len(turns) < _MIN_TURNS:
        return []
    allowed = _ENVELOPE_TOLERANCE * (float(np.ptp(column)) / 50 if tolerance is None else tolerance)
    fast = np.diff(times[turns]) < slower_than / 2
    return [
        _swing(times, column, turns[a : b + 1], allowed) for a, b in _runs(fast) if b + 1 - a >= _MIN_TURNS
    ]


def turning_points(column: Array) -> list[int]:
    """Indices of highs and lows in turn that differ from their neighbours by more than ripple."""
    least = _RIPPLE_SHARE * float(np.ptp(column))
    slopes = np.sign(np.diff(column))
    moving = np.flatnonzero(slopes)
    candidates = moving[1:][slopes[moving[1:]] != slopes[moving[:-1]]].tolist()
    turns: list[int] = []
    for k in candidates:
        if len(turns) > 1 and (column[k] - column[turns[-1]]) * (column[turns[-1]] - column[turns[-2]]) > 0:
            turns[-1] = k
        elif not turns or abs(column[k] - column[turns[-1]]) > least:
            turns.append(k)
    return turns


def _swing(times: Array, column: Array, turns: list[int], tolerance: float) -> Swing:
    rising = [column[b] > column[a] for a, b in pairwise(turns)]
    high = [k for k, up in zip(turns[1:], rising, strict=True) if up]
    low = [k for k, up in zip(turns[1:], rising, strict=True) if not up]
    (low if rising[0] else high).insert(0, turns[0])
    return Swing(
        float(times[turns[0]]),
        float(times[turns[-1]]),
        tuple(_phases(times[turns])),
        _envelope(times, column, low, tolerance),
        _envelope(times, column, high, tolerance),
    )


def _envelope(times: Array, column: Array, extrema: list[int], tolerance: float) -> Points:
    at, values = times[extrema], column[extrema]
    # A peak between two samples is cut off; envelopes differ by what a signal changes there in one step.
    inner = np.clip(extrema, 1, len(column) - 2)
    sides = np.maximum(np.abs(column[inner] - column[inner - 1]), np.abs(column[inner] - column[inner + 1]))
    chance = float(np.median(sides))
    chosen, _ = breakpoints(at, values, tolerance=max(tolerance, chance), most=_MOST_ENVELOPE_POINTS)
    return _points(at, values, chosen)


def _phases(turns: Array) -> Iterator[Phase]:
    """Divide an oscillation where its period changes for good; a single odd swing is no new phase."""
    periods = 2 * np.diff(turns)
    smooth = np.array([np.median(periods[max(0, k - 2) : k + 3]) for k in range(len(periods))])
    begin = 0
    for k in range(1, len(smooth) + 1):
        sofar = float(np.median(smooth[begin:k]))
        if k == len(smooth):
            yield Phase(float(turns[begin]), sofar)
        elif k - begin >= _MIN_PHASE and len(smooth) - k >= _MIN_PHASE:
            ahead = float(np.median(smooth[k : k + _MIN_PHASE]))
            if all(max(p / sofar, sofar / p) > _PERIOD_FACTOR for p in (float(smooth[k]), ahead)):
                yield Phase(float(turns[begin]), sofar)
                begin = k


def _runs(flags: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First index and index after the last of each run of true flags."""
    edges = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    yield from zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True)


def _breakpoints(
    times: Array, column: Array, tolerance: float, kept: Iterable[float], *, most: int
) -> tuple[list[int], float]:
    inside = [_index(times, t) for t in kept if times[0] <= t <= times[-1]]
    return breakpoints(times, column, tolerance=tolerance, kept=inside, most=most)


def _worst(times: Array, column: Array, a: int, b: int) -> tuple[float, int, int, int]:
    """Negative largest distance from the line between two points, their indices and that of the largest."""
    if b - a < 2:
        return 0.0, a, a, b
    inner = slice(a + 1, b)
    line = column[a] + (column[b] - column[a]) * (times[inner] - times[a]) / (times[b] - times[a])
    distance = np.abs(column[inner] - line)
    k = int(distance.argmax())
    return -float(distance[k]), a, a + 1 + k, b


def _points(times: Array, column: Array, chosen: Iterable[int]) -> Points:
    return tuple((float(times[k]), float(column[k])) for k in chosen)


def _index(times: Array, time: float) -> int:
    return int(np.abs(times - time).argmin())
