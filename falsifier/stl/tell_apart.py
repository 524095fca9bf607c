"""Trajectories that tell two formulas apart: one of them satisfies a formula and violates the other."""

from collections.abc import Iterator, Mapping
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.errors import MonitorError
from falsifier.stl.expression import Number
from falsifier.stl.formula import Formula
from falsifier.stl.intervals import Interval
from falsifier.stl.monitor import Monitor

Floats = NDArray[np.float64]
# Random trajectories per round, and rounds with one more step each.
_PER_ROUND, _ROUNDS = 300, 5
# Samples of a signal at once, and per round: on very fine grids, fewer trajectories are tried.
_AT_ONCE, _MOST = 4_000_000, 30_000_000
_FEWEST = 20
# Share of the spread of all levels by which a level is above or below a threshold.
_BESIDE = 0.1


def tell_apart(
    satisfied: Formula, violated: Formula, *, step: float, samples: int, ranges: Mapping[str, Interval]
) -> Trajectory | None:
    """Return a trajectory of few steps that satisfies one formula and violates the other; None: none found.

    The step of the time grid is in s. Signals without a range may have any value.

    Raises:
        FormulaError: if a formula does not fit the time grid.
    """
    formulas = (satisfied, violated)
    wanted, unwanted = (Monitor(f, step, samples) for f in formulas)
    for cuts, columns in _random(formulas, step, samples, ranges):
        kept, broken = _robustness(wanted, columns), -_robustness(unwanted, columns)
        valid = np.flatnonzero((kept >= 0) & (broken > 0))
        if len(valid):
            # Long pieces first: a spike of one sample tells readers little.
            shortest = np.min([_shortest(c[valid], samples) for c in cuts.values()], axis=0)
            margin = np.minimum(kept, broken)[valid]
            best = int(valid[np.lexsort((margin, shortest, margin > 0))[-1]])
            times = np.linspace(0.0, step * (samples - 1), samples)
            return Trajectory(times, {n: column[best].copy() for n, column in columns.items()})
    return None


def differences(
    first: Formula, second: Formula, *, step: float, samples: int, ranges: Mapping[str, Interval]
) -> set[int]:
    """Return which signs the first formula's robustness less the second's has; empty: none but 0 was found.

    The arguments are those of ``tell_apart``.
    """
    one, other = (Monitor(f, step, samples) for f in (first, second))
    found: set[int] = set()
    for _, columns in _random((first, second), step, samples, ranges):
        signs = np.sign(_robustness(one, columns) - _robustness(other, columns))
        found |= {int(sign) for sign in signs[np.isfinite(signs) & (signs != 0)]}
    return found


def _random(
    formulas: tuple[Formula, ...], step: float, samples: int, ranges: Mapping[str, Interval]
) -> Iterator[tuple[dict[str, NDArray[np.int64]], dict[str, Floats]]]:
    """Yield random trajectories, each signal of shape (m, samples), and the samples where they change."""
    names = list(dict.fromkeys(name for f in formulas for name in f.signals)) or [""]  # of numbers alone
    levels = {name: _levels(formulas, ranges.get(name, Interval())) for name in names}
    moments = _moments(formulas, step, samples)
    rng = np.random.default_rng(0)
    for switches, count in ((s, c) for s in range(_ROUNDS) for c in _batches(samples)):
        cuts = {n: rng.choice(moments, size=(count, switches)) for n in names}
        yield cuts, {n: _steps(rng, levels[n], cuts[n], samples) for n in names}


def _batches(samples: int) -> list[int]:
    """Return how many trajectories to try at a time in one round."""
    total = min(_PER_ROUND, max(_FEWEST, _MOST // samples))
    size = min(total, max(1, _AT_ONCE // samples))
    return [min(size, total - done) for done in range(0, total, size)]


def _robustness(monitor: Monitor, columns: Mapping[str, Floats]) -> Floats:
    """Return the robustness of each trajectory; NaN for those outside the domain of a division or root."""
    with suppress(MonitorError):
        return monitor.batch(columns)
    found = np.full(len(next(iter(columns.values()))), np.nan)
    for k in range(len(found)):
        with suppress(MonitorError):
            found[k] = monitor.batch({name: column[k : k + 1] for name, column in columns.items()})[0]
    return found


def _levels(formulas: tuple[Formula, ...], allowed: Interval) -> Floats:
    """Return values on both sides of each number in the formulas, within the range of the signal."""
    sides = (side for f in formulas for p in f.predicates for side in p.sides)
    numbers = [e.value for side in sides for e in side.walk() if isinstance(e, Number)]
    ends = [e for e in (allowed.low, allowed.high) if np.isfinite(e)]
    known = np.array(sorted({0.0, *numbers, *ends}))
    beside = _BESIDE * (known[-1] - known[0] or 1.0)
    between = (known[1:] + known[:-1]) / 2
    spread = np.concatenate([known - beside, known, between, known + beside])
    kept = spread[(spread >= allowed.low) & (spread <= allowed.high)]
    return np.asarray(kept if len(kept) else np.array(ends), dtype=np.float64)


def _moments(formulas: tuple[Formula, ...], step: float, samples: int) -> NDArray[np.int64]:
    """Return samples at, beside and in the middle of the bounds of windows."""
    bounds = {round(t / step) for f in formulas for w in f.windows for t in (w.start, w.end)}
    sums = {a + b for a in bounds for b in bounds}
    middle = {(a + b) // 2 for a in bounds for b in bounds}
    found = {k + d for k in bounds | sums for d in (-1, 0, 1)} | middle | {samples // 4, samples // 2}
    return np.array(sorted(k for k in found if 0 < k < samples) or [samples - 1], dtype=np.int64)


def _steps(rng: np.random.Generator, levels: Floats, cuts: NDArray[np.int64], samples: int) -> Floats:
    """Return random piecewise constant signals that change at given samples, shape (m, samples)."""
    values = rng.choice(levels, size=(cuts.shape[0], cuts.shape[1] + 1))
    piece = np.zeros((len(cuts), samples), dtype=np.intp)
    for column in cuts.T:
        piece += column[:, None] <= np.arange(samples)
    return np.take_along_axis(values, piece, axis=1)


def _shortest(cuts: NDArray[np.int64], samples: int) -> NDArray[np.int64]:
    """Return the length of the shortest piece of each signal, in samples."""
    ends = np.pad(np.sort(cuts, axis=1), ((0, 0), (1, 1)), constant_values=(0, samples))
    shortest: NDArray[np.int64] = np.diff(ends, axis=1).min(axis=1)
    return shortest
