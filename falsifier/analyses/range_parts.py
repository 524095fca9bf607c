"""What coverage counts by: parts of a range, values of a discrete signal, and how fast an input changed."""

from collections.abc import Iterable
from itertools import pairwise
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from falsifier.core.signals import Signal
from falsifier.record.manifest import InputRecord

# Parts of a range: enough to see gaps, few enough that a hundred simulations can try most pairs of them.
PARTS = 10
# How fast an input changed, slowest first; see pace_of.
PACES = ("constant", "slow", "medium", "fast", "steps")
# An input is slow if its range takes at least this share of the simulated time, and fast if at most that.
SLOW, FAST = 1 / 2, 1 / 20
# Points of a cubic piece at which its slope is calculated.
_PER_PIECE = np.linspace(0.0, 1.0, 5)

Array = NDArray[np.float64]
Counts = NDArray[np.intp]


def _allowed(r: InputRecord) -> list[int]:
    """Return the numbers that an integer, Boolean or enumeration may have; empty if there are many."""
    if r.items:
        return sorted(n for _, n in r.items if r.low <= n <= r.high)
    first, last = ceil(r.low), floor(r.high)
    return list(range(first, last + 1)) if last - first < PARTS else []


def edges_of(r: InputRecord) -> list[tuple[float, float]]:
    """Return the ends of each part of a range; a part of a short list of numbers is one number."""
    if r.kind != "real" and (numbers := _allowed(r)):
        return [(float(n), float(n)) for n in numbers]
    if r.low == r.high:
        return [(r.low, r.high)]
    return list(pairwise(np.linspace(r.low, r.high, PARTS + 1).tolist()))


def cells_of(r: InputRecord, values: Array) -> Counts:
    """Return the part of the range in which each value is, shape (n,)."""
    edges = np.array(edges_of(r))
    between = (edges[1:, 0] + edges[:-1, 1]) / 2
    return np.searchsorted(between, values, side="right")


def labels_of(kind: str, items: Iterable[tuple[str, int]]) -> dict[int, str]:
    """Return the name of each value of a Boolean or enumeration; empty for other kinds."""
    if kind == "boolean":
        return {0: "false", 1: "true"}
    return {number: label for label, number in items}


def allowed_labels(r: InputRecord) -> dict[int, str]:
    """Return the numbers that a discrete input may have as names; empty if there are many."""
    return {n: str(n) for n in _allowed(r)}


def fastest_rate(signal: Signal, stop_time: float) -> float | None:
    """Return the fastest continuous change in units per s; None if the value only changes in steps.

    A signal that is sampled and held counts as what is sampled: its period is the model's, not the search's.
    """
    if len(signal.times) == 1 or signal.interpolation == "constant":
        return None
    pieces = signal.held(None).pieces(stop_time)[:-1]
    at = np.diff(signal.times)[:, np.newaxis] * _PER_PIECE
    slopes = pieces[:, 2:3] + 2 * pieces[:, 3:4] * at + 3 * pieces[:, 4:5] * at**2
    return float(np.abs(slopes).max(initial=0.0))


def pace_of(signal: Signal, rate: float | None, r: InputRecord, stop_time: float) -> str:
    """Return which of PACES an input had at its fastest."""
    if signal.switches == 0:
        return "constant"
    if rate is None:
        return "steps"
    duration = (r.high - r.low) / rate
    if duration >= SLOW * stop_time:
        return "slow"
    return "fast" if duration <= FAST * stop_time else "medium"
