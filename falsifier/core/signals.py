"""Input signals: control points, an interpolation between them, optionally sampled and held.

Engines, files and models all represent an input as a :class:`Signal`::

    full_throttle = Signal.evenly((100.0,) * 7, stop_time=50.0)
    full_throttle.sample(np.linspace(0, 50, 5001))
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from math import ceil, inf, isfinite, ulp
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from falsifier.core.arguments import one_of, positive
from falsifier.core.fixed import fixed
from falsifier.errors import SpecError

Interpolation = Literal["pchip", "linear", "constant"]
INTERPOLATIONS: tuple[str, ...] = get_args(Interpolation)

# A step between two slopes is a ramp, as signals have one value per time. It ends at the time of the step
# and takes no more than this, in s and as a share of that time.
_STEP_RAMP = 2e-9
# Up to which share of it a time may be rounded down: in floating point 0.15 / 0.05 is slightly less than 3.
TIME_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Signal:
    """One input signal over time.

    Attributes:
        times: control-point times in s, strictly increasing, the first one 0.
        values: control-point values in the input's unit, as many as times.
        interpolation: ``pchip`` (scipy's PchipInterpolator), ``linear``, or ``constant`` (each value is held
            until the next control point). After the last control point its value is kept.
        hold: period in s at which the interpolated signal is sampled and held; None: it is not held.

    Raises:
        SpecError: if the lengths differ, the times do not increase from 0, or a value is not finite.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    interpolation: Interpolation = "pchip"
    hold: float | None = None

    def __post_init__(self) -> None:
        try:
            is_finite = all(map(isfinite, (*self.times, *self.values)))
        except (TypeError, OverflowError):
            raise SpecError("control-point times and values: expected sequences of numbers") from None
        # Lists neither compare nor hash, whole numbers make arrays of integers, JSON has no numbers of numpy.
        for name in ("times", "values"):
            object.__setattr__(self, name, tuple(map(float, getattr(self, name))))
        if len(self.times) != len(self.values) or not self.times:
            raise SpecError(
                f"{len(self.times)} times and {len(self.values)} values: expected equally many, one or more"
            )
        disordered = next((f"{b!r} after {a!r}" for a, b in pairwise(self.times) if b <= a), "")
        if self.times[0] != 0.0 or disordered:
            got = disordered or f"{self.times[0]!r} as the first"
            raise SpecError(f"control-point times must increase strictly from 0, got {got}")
        if not is_finite:
            wrong = next(v for v in (*self.times, *self.values) if not isfinite(v))
            raise SpecError(f"control-point times and values must be finite numbers, got {wrong}")
        one_of("interpolation", self.interpolation, INTERPOLATIONS)
        if self.hold is not None:
            positive("hold", self.hold)

    @classmethod
    def evenly(
        cls,
        values: Sequence[float],
        *,
        stop_time: float,
        interpolation: Interpolation = "pchip",
        hold: float | None = None,
    ) -> "Signal":
        """Return the signal with evenly spaced control points over [0, stop_time]; see ``even_times``."""
        times = even_times(len(values), stop_time=stop_time, interpolation=interpolation)
        return cls(times, tuple(float(v) for v in values), interpolation, hold)

    def sample(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values at the given times in s, same shape as ``times``."""
        at = np.asarray(times, dtype=np.float64)
        if len(self.times) == 1:
            return np.full(at.shape, self.values[0])
        if self.hold is not None:
            period = np.floor(at / self.hold * (1.0 + TIME_ROUNDING)).astype(np.intp)
            return _held_values(self, int(period.max(initial=0)) + 1)[period]
        return _interpolate(self, at)

    @np.errstate(over="ignore")  # what comes of slopes that no number can state, the simulation tells
    def pieces(self, stop_time: float) -> NDArray[np.float64]:
        """Return the signal on [0, stop_time] as cubic pieces, for solvers that choose their own times.

        Returns:
            One row per piece, shape (n, 5): its start time s in s, and the coefficients of 1, (t - s),
            (t - s)**2 and (t - s)**3. The last piece extends indefinitely.
        """
        if self.hold is not None and len(self.times) > 1:
            values = _held_values(self, int(stop_time / self.hold * (1.0 + TIME_ROUNDING)) + 1)
            return constant_pieces(np.arange(len(values), dtype=np.float64) * self.hold, values)
        knots, values = np.asarray(self.times), np.asarray(self.values)
        if self.interpolation == "pchip" and len(knots) > 1:
            return _pchip(self.times, self.values).copy()
        table = constant_pieces(knots, values)
        if self.interpolation == "linear":
            table[:-1, 2] = np.diff(values) / np.diff(knots)
        return table

    def held(self, hold: float | None) -> "Signal":
        """Return the same signal, sampled and held with this period in s; None: not held."""
        return replace(self, hold=hold)

    @property
    def moments(self) -> tuple[float, ...]:
        """Times in s of the control points; of constant pieces that are held, when they are sampled first."""
        if self.hold is None or self.interpolation != "constant":
            return self.times
        return tuple(ceil(t / self.hold * (1.0 - TIME_ROUNDING)) * self.hold for t in self.times)

    def stepped(self, stop_time: float = inf) -> "Signal":
        """Return the same signal; held constant pieces begin where they are sampled, if that is in time."""
        if (moments := self.moments) is self.times:
            return self
        last = stop_time * (1.0 + TIME_ROUNDING)
        points = {t: v for t, v in zip(moments, self.values, strict=True) if t <= last}
        return replace(self, times=tuple(points), values=tuple(points.values()))

    @property
    def switch_times(self) -> tuple[float, ...]:
        """Times in s of the control points with another value than the one before."""
        return tuple(t for t, (a, b) in zip(self.times[1:], pairwise(self.values), strict=True) if a != b)

    @property
    def switches(self) -> int:
        """Number of changes of value from one control point to the next."""
        return len(self.switch_times)

    @property
    def shortest_dwell(self) -> float | None:
        """Shortest time in s between two changes of value, steps counted as one; None with fewer than two."""
        pairs = pairwise(self.switch_times)
        return min((b - a for a, b in pairs if b - a > 2.0 * step_ramp(b)), default=None)


@lru_cache(maxsize=256)
def even_times(count: int, *, stop_time: float, interpolation: Interpolation) -> tuple[float, ...]:
    """Return the times in s of evenly spaced control points.

    Interpolated signals have control points at both ends of [0, stop_time]. Constant pieces are equally long,
    so their last control point is one piece before the end. A single control point is at 0.
    """
    pieces = count if interpolation == "constant" else max(count - 1, 1)
    return tuple(stop_time * i / pieces for i in range(count))


def step_ramp(time: float) -> float:
    """Return how long in s the ramp is that stands for a step at this time.

    It is shorter than any communication step, as simulations have at most ten million, and no rounding.
    """
    return max(_STEP_RAMP * min(time, 1.0), ulp(time))


# The same values are needed twice in succession: for the simulation and for the trajectory's input columns.
@lru_cache(maxsize=16)
def _held_values(signal: Signal, count: int) -> NDArray[np.float64]:
    """Return the values at the first ``count`` sampling instants of a held signal, shape (count,)."""
    assert signal.hold is not None, "only held signals have sampling instants"
    return fixed(_interpolate(signal, np.arange(count, dtype=np.float64) * signal.hold))


def _interpolate(signal: Signal, at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the interpolated values of a signal with two or more control points, ignoring its hold."""
    knots, values = np.asarray(signal.times), np.asarray(signal.values)
    if signal.interpolation == "constant":
        return np.asarray(values[np.searchsorted(knots, at * (1.0 + TIME_ROUNDING), side="right") - 1])
    is_linear = signal.interpolation == "linear"
    curve = np.interp(at, knots, values) if is_linear else _evaluate(_pchip(signal.times, signal.values), at)
    return np.asarray(curve).clip(values.min(), values.max())  # rounding alone leaves the range


@lru_cache(maxsize=256)
def _pchip(times: tuple[float, ...], values: tuple[float, ...]) -> NDArray[np.float64]:
    """Return the pieces (see ``Signal.pieces``) of the monotone cubic interpolant; the last one is constant.

    Slopes as in Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304, end slopes as in Moler,
    Numerical Computing with MATLAB (2004), section 3.6. The result equals scipy's PchipInterpolator.
    """
    # Plain floats: for the few control points of a search, numpy's overhead per call would dominate.
    steps = [b - a for a, b in pairwise(times)]
    secants = [(b - a) / h for (a, b), h in zip(pairwise(values), steps, strict=True)]
    if len(steps) == 1:
        slopes = [secants[0], secants[0]]
    else:
        slopes = [
            inner_slope(*lengths, *sides)
            for lengths, sides in zip(pairwise(steps), pairwise(secants), strict=True)
        ]
        first = end_slope(steps[0], steps[1], secants[0], secants[1])
        slopes = [first, *slopes, end_slope(steps[-1], steps[-2], secants[-1], secants[-2])]
    rows = [
        (t, y, d, (3.0 * m - 2.0 * d - e) / h, (d + e - 2.0 * m) / (h * h))
        for t, y, (d, e), m, h in zip(times, values, pairwise(slopes), secants, steps, strict=False)
    ]
    return fixed(np.array([*rows, (times[-1], values[-1], 0.0, 0.0, 0.0)]))


def inner_slope(step: float, next_step: float, secant: float, next_secant: float) -> float:
    """Return the slope of a pchip curve between two pieces: the weighted harmonic mean of their secants.

    It is 0 at a peak, in a valley or on a flat piece.
    """
    if secant * next_secant <= 0.0:
        return 0.0
    weight, next_weight = step + 2.0 * next_step, 2.0 * step + next_step
    return (weight + next_weight) / (weight / secant + next_weight / next_secant)


def end_slope(step: float, next_step: float, secant: float, next_secant: float) -> float:
    """Return the slope of a pchip curve at an end: by three points, limited to preserve the data's shape.

    ``step`` and ``secant`` are length and mean slope of the piece at the end, the others of that beside it.
    """
    slope = ((2.0 * step + next_step) * secant - step * next_secant) / (step + next_step)
    if slope * secant <= 0.0:
        return 0.0
    return 3.0 * secant if secant * next_secant <= 0.0 and abs(slope) > 3.0 * abs(secant) else slope


def constant_pieces(starts: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the pieces (see ``Signal.pieces``) of a signal that has each value from its start on."""
    table = np.zeros((len(starts), 5))
    table[:, 0], table[:, 1] = starts, values
    return table


def _evaluate(table: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values of the pieces at times >= 0, same shape as ``at``."""
    order = np.searchsorted(table[1:, 0], at, side="right")
    start, c0, c1, c2, c3 = table.T
    dt = at - start[order]
    value = c3[order]
    for c in (c2, c1, c0):
        value *= dt
        value += c[order]
    return np.asarray(value)
