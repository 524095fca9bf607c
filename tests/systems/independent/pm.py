"""Pacemaker in mode AOO: when each pulse begins, counted in ticks of 1 ms."""

import numpy as np
from numpy.typing import NDArray


def counts(rates: NDArray[np.float64]) -> NDArray[np.int64]:
    """Number of pulses begun at each tick, shape (ticks,).

    Args:
        rates: lower rate limit at each tick, shape (ticks,).
    """
    charge = np.floor(60000.0 / np.floor(rates) - 2 + 0.5).astype(int)
    ticks = np.arange(len(rates))
    count = np.zeros(len(rates), dtype=np.int64)
    start = 1  # the charge begins one tick after the start
    while True:
        ready = np.flatnonzero((ticks > start) & (ticks - start >= charge))
        if not len(ready):
            return count
        count[ready[0] :] += 1
        start = int(ready[0]) + 2  # a pulse lasts 2 ms
