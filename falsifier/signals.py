"""Input signals: control points, an interpolation between them, optionally sampled and held.

A :class:`Signal` is the one form in which every proposer, every file and every model speaks of an input::

    full_throttle = Signal.evenly((100.0,) * 7, stop_time=50.0)
    full_throttle.sample(np.linspace(0, 50, 5001))
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isfinite
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

Interpolation = Literal["pchip", "linear", "constant"]
INTERPOLATIONS: tuple[str, ...] = get_args(Interpolation)

# A grid time such as 0.15 = 3 * 0.05 falls short of its multiple by rounding; seconds.
_TIME_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Signal:
    """One input signal over time.

    Attributes:
        times: control-point times in s, strictly increasing, the first one 0.
        values: control-point values in the input's unit, as many as times.
        interpolation: ``pchip`` (scipy's PchipInterpolator), ``linear``, or ``constant`` (each value is held
            until the next control point). After the last control point its value is kept.
        hold: sampling period in s; the interpolated signal is sampled and held with it. None: continuous.

    Raises:
        ValueError: for unequal lengths, times that do not increase from 0, or values that are not finite.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    interpolation: Interpolation = "pchip"
    hold: float | None = None

    def __post_init__(self) -> None:
        if len(self.times) != len(self.values) or not self.times:
            raise ValueError(
                f"{len(self.times)} times and {len(self.values)} values: expected equally many, one or more"
            )
        if self.times[0] != 0.0 or any(b <= a for a, b in pairwise(self.times)):
            raise ValueError(f"control-point times must increase strictly from 0, got {list(self.times)}")
        if not all(map(isfinite, self.times)) or not all(map(isfinite, self.values)):
            raise ValueError("control-point times and values must be finite numbers")
        if self.interpolation not in INTERPOLATIONS:
            raise ValueError(
                f"unknown interpolation {self.interpolation!r}, expected one of {INTERPOLATIONS}"
            )
        if self.hold is not None and not self.hold > 0:
            raise ValueError(f"hold must be a positive number of seconds, got {self.hold}")

    @classmethod
    def evenly(
        cls,
        values: Sequence[float],
        *,
        stop_time: float,
        interpolation: Interpolation = "pchip",
        hold: float | None = None,
    ) -> "Signal":
        """Return the signal with evenly spaced control points over [0, stop_time] (see even_times)."""
        times = even_times(len(values), stop_time=stop_time, interpolation=interpolation)
        return cls(times, tuple(float(v) for v in values), interpolation, hold)

    def sample(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at the given times in s, shape as times."""
        at = np.asarray(times, dtype=np.float64)
        if self.hold is not None:
            at = np.floor(at / self.hold + _TIME_ROUNDING) * self.hold
        if len(self.times) == 1:
            return np.full(at.shape, self.values[0])
        knots, values = np.asarray(self.times), np.asarray(self.values)
        at = np.clip(at, knots[0], knots[-1])
        if self.interpolation == "linear":
            return np.asarray(np.interp(at, knots, values))
        if self.interpolation == "constant":
            return np.asarray(values[np.searchsorted(knots, at + _TIME_ROUNDING, side="right") - 1])
        from scipy.interpolate import PchipInterpolator

        return np.asarray(PchipInterpolator(knots, values)(at))

    def held(self, hold: float | None) -> "Signal":
        """Return the same signal sampled and held with this period in s."""
        return replace(self, hold=hold)

    @property
    def switches(self) -> int:
        """Number of changes of value from one control point to the next."""
        return sum(a != b for a, b in pairwise(self.values))

    @property
    def shortest_dwell(self) -> float | None:
        """Shortest time in s between two changes of value; None with fewer than two changes."""
        changes = [t for t, (a, b) in zip(self.times[1:], pairwise(self.values), strict=True) if a != b]
        return min((b - a for a, b in pairwise(changes)), default=None)


def even_times(count: int, *, stop_time: float, interpolation: Interpolation) -> tuple[float, ...]:
    """Times in s of evenly spaced control points.

    Interpolated signals have points at both ends of [0, stop_time]; constant pieces are equally long, so
    their last point lies one piece before the end. One point is at 0.
    """
    if count < 1:
        raise ValueError(f"a signal needs at least one control point, got {count}")
    pieces = count if interpolation == "constant" else max(count - 1, 1)
    return tuple(stop_time * i / pieces for i in range(count))
