"""Curves over the number of simulations."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from falsifier.campaigns.analysis.runs import Run

Curve = tuple[NDArray[np.float64], NDArray[np.float64]]


def falsification_curve(runs: Iterable[Run]) -> Curve:
    """Share of finished runs that are falsified, over the number of simulations.

    Returns:
        Numbers of simulations, from 0 to the maximum of all runs, and the share at each, both of shape (k,);
        the share is constant between two numbers.
    """
    finished = [run for run in runs if run.finished]
    counts = sorted(run.simulations for run in finished if run.falsified)
    shares = np.arange(len(counts) + 1) / max(len(finished), 1)
    largest = max((run.simulations for run in finished), default=0)
    return np.array([0.0, *counts, largest]), np.append(shares, shares[-1])


def thinned(robustness: NDArray[np.float64], limit: int) -> Curve:
    """Robustness values for drawing: all of them, or the lowest in each of ``limit`` equal parts.

    Args:
        robustness: robustness of each simulation, shape (n,); NaN without a verdict.
        limit: maximum number of values to keep.

    Returns:
        Numbers of the simulations, from 1, and their values; without NaN.
    """
    valid = np.flatnonzero(~np.isnan(robustness))
    if len(valid) > limit:
        parts = np.array_split(valid, limit)
        valid = np.array([part[np.argmin(robustness[part])] for part in parts])
    return (valid + 1).astype(np.float64), robustness[valid]


def improvements(robustness: NDArray[np.float64]) -> Curve:
    """Simulations that improve on the smallest robustness so far: their numbers, from 1, and the values."""
    if not len(robustness):
        return robustness, robustness
    best = np.fmin.accumulate(robustness)
    before = np.append(np.inf, np.nan_to_num(best[:-1], nan=np.inf))
    at = np.flatnonzero(np.nan_to_num(best, nan=np.inf) < before)
    return (at + 1).astype(np.float64), best[at]
