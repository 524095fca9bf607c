"""Curves over simulations."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from falsifier.campaigns.analysis.runs import Run

Curve = tuple[NDArray[np.float64], NDArray[np.float64]]


def falsification_curve(runs: Iterable[Run]) -> Curve:
    """Share of finished runs that are falsified after so many simulations.

    Returns:
        Numbers of simulations from 0 to the most that any run used, and the shares there; the share holds
        until the next number. Shape (k,) both.
    """
    finished = [run for run in runs if run.finished]
    counts = sorted(run.simulations for run in finished if run.falsified)
    shares = np.arange(len(counts) + 1) / max(len(finished), 1)
    most = max((run.simulations for run in finished), default=0)
    return np.array([0.0, *counts, most]), np.append(shares, shares[-1])


def thinned(robustness: NDArray[np.float64], most: int) -> Curve:
    """Robustness values for drawing: all of them, or the lowest of each of so many equal stretches.

    Args:
        robustness: of each simulation, shape (n,), NaN where there is none.
        most: number of values to keep.

    Returns:
        Numbers of the simulations from 1, and the values there; without NaN.
    """
    valid = np.flatnonzero(~np.isnan(robustness))
    if len(valid) > most:
        stretches = np.array_split(valid, most)
        valid = np.array([s[np.argmin(robustness[s])] for s in stretches])
    return (valid + 1).astype(np.float64), robustness[valid]


def improvements(robustness: NDArray[np.float64]) -> Curve:
    """Where the smallest robustness so far falls: numbers of the simulations from 1, and the values."""
    if not len(robustness):
        return robustness, robustness
    best = np.fmin.accumulate(robustness)
    before = np.append(np.inf, np.nan_to_num(best[:-1], nan=np.inf))
    at = np.flatnonzero(np.nan_to_num(best, nan=np.inf) < before)
    return (at + 1).astype(np.float64), best[at]
