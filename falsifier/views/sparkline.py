"""Small pictures of signals in one line of text."""

import numpy as np

from falsifier.core.trajectory import Trajectory

_BARS = "▁▂▃▄▅▆▇█"
_WIDTH = 48


def trace_lines(trajectory: Trajectory, *, width: int = _WIDTH) -> list[str]:
    """Return one line per signal: its name, its course over time, and its smallest and largest value."""
    longest = max(map(len, trajectory.columns), default=0)
    return [
        f"{name:<{longest}}  {sparkline(column, width=width)}  {_span(column)}"
        for name, column in trajectory.columns.items()
    ]


def sparkline(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]], *, width: int = _WIDTH) -> str:
    """Return a column as a line of bars, each the value in the middle of its part of the time.

    >>> sparkline(np.array([0.0, 0.0, 1.0, 1.0]), width=4)
    '▁▁██'
    """
    at = ((np.arange(width) + 0.5) * len(values) / width).astype(int)
    shown = np.asarray(values)[at]
    low, high = float(np.min(values)), float(np.max(values))
    heights = np.zeros(width) if low == high else (shown - low) / (high - low)
    return "".join(_BARS[round(h * (len(_BARS) - 1))] for h in heights)


def _span(column: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    low, high = float(np.min(column)), float(np.max(column))
    return f"constant {low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"
