"""Ranges of what may be varied: inputs with their parameterization, parameters with their scale."""

from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from math import ceil, floor, isfinite, log
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from falsifier.core.arguments import finite, instance, one_of, positive, whole
from falsifier.core.signals import INTERPOLATIONS, Interpolation
from falsifier.errors import SpecError

ValueKind = Literal["real", "integer", "boolean", "enumeration"]
Scale = Literal["linear", "log"]

# Values outside their range by at most this share of it are clipped, others rejected: bounds that were
# printed with six digits may come back rounded outwards.
_ROUNDING_SHARE = 1e-5


@dataclass(frozen=True, slots=True)
class Freedom:
    """Limits within which engines may choose an input's control points and interpolation.

    Attributes:
        max_control_points: maximum number of control points.
        min_interval: minimum time in s between two control points.

    Raises:
        SpecError: if one of them is not positive.
    """

    max_control_points: int
    min_interval: float

    def __post_init__(self) -> None:
        whole("max_control_points", self.max_control_points, least=1)
        positive("min_interval", self.min_interval)


def number_names(kind: str, items: Iterable[tuple[str, int]]) -> dict[int, str]:
    """Return the name of each number of a Boolean or an enumeration; empty for other kinds."""
    return {0: "false", 1: "true"} if kind == "boolean" else {number: name for name, number in items}


@dataclass(frozen=True, slots=True)
class Range:
    """What inputs and parameters have in common; the items are names and numbers of an enumeration's."""

    name: str
    low: float
    high: float
    _: KW_ONLY
    unit: str = ""
    description: str = ""
    kind: ValueKind = "real"
    items: tuple[tuple[str, int], ...] = ()
    scale: Scale = "linear"

    def __post_init__(self) -> None:
        what = self.label
        low, high = finite(f"{what}: low", self.low), finite(f"{what}: high", self.high)
        if low > high:
            raise SpecError(f"{what}: expected low <= high, got [{low:.12g}, {high:.12g}]")
        if not isfinite(high - low):
            raise SpecError(f"{what}: [{low:g}, {high:g}] is too wide to calculate with; narrow the range")
        one_of(f"{what}: kind", self.kind, get_args(ValueKind))
        one_of(f"{what}: scale", self.scale, get_args(Scale))
        if self.scale == "log":
            if isinstance(self, InputRange) or self.kind != "real":
                raise SpecError(f'{what}: only real parameters can have scale "log"; leave it out')
            if low <= 0:
                raise SpecError(
                    f'{what}: scale "log" needs low > 0, got [{low:.12g}, {high:.12g}]; raise low, or make '
                    'scale "linear"'
                )
        if self.kind == "real":
            return
        if not (numbers := self.numbers):
            missing = "item of the enumeration" if self.items else "integer"
            raise SpecError(f"{what}: [{low:.12g}, {high:.12g}] contains no {missing}; widen the range")
        # Engines try the bounds, so these must be numbers that are allowed.
        object.__setattr__(self, "low", float(numbers[0]))
        object.__setattr__(self, "high", float(numbers[-1]))

    @property
    def numbers(self) -> Sequence[int]:
        """The integers in it that are allowed, in order."""
        items = sorted({n for _, n in self.items if self.low <= n <= self.high})
        return items if self.items else range(ceil(self.low), floor(self.high) + 1)

    def at(self, share: Any) -> Any:
        """Return the value at a share of the way from low to high, as the scale measures it.

        Both are numbers or arrays of one shape. Engines search shares from 0 to 1: nothing else in them knows
        about scales.

        >>> ParameterRange("R", 1e-6, 1e-2, scale="log").at(0.25), ParameterRange("k", 2.0, 4.0).at(0.25)
        (1e-05, 2.5)
        """
        if self.scale == "log" and self.low < self.high:
            return self.low ** (1.0 - share) * self.high**share  # exact at both ends
        return self.low + (self.high - self.low) * share

    def share_of(self, value: Any) -> Any:
        """Return the share at which a value is, the inverse of ``at``; 0 if there is but one value."""
        if self.scale == "log":
            return (np.log(value) - log(self.low)) / ((log(self.high) - log(self.low)) or 1.0)
        return (value - self.low) / ((self.high - self.low) or 1.0)

    @property
    def manner(self) -> str:
        """What follows a range in texts: how it is searched, unless evenly."""
        return " in decades" if self.scale == "log" else ""

    @property
    def label(self) -> str:
        """What errors call it."""
        return f"input {self.name!r}" if isinstance(self, InputRange) else f"parameter {self.name!r}"


@dataclass(frozen=True, slots=True)
class InputRange(Range):
    """One searched input signal.

    Attributes:
        name: the input's name in the model.
        low: lower bound in the input's unit; the next allowed number, unless reals are.
        high: upper bound.
        unit: the input's unit, empty if unknown.
        description: its meaning, from the model.
        kind: type of its values; every type except real has integer values, held between control points.
        items: names and numbers of an enumeration's items.
        control_points: number of evenly spaced control points of the fixed parameterization, at most that of
            a free one.
        interpolation: interpolation between the control points.
        hold: sample-and-hold period in s, or None.
        free: limits of a free parameterization, or None if only the fixed one is allowed.

    Raises:
        SpecError: if the bounds are not finite, in the wrong order or without an allowed number between them,
            or the control points, interpolation, hold or free are not as above.
    """

    _: KW_ONLY
    control_points: int = 1
    interpolation: Interpolation = "pchip"
    hold: float | None = None
    free: Freedom | None = None

    def __post_init__(self) -> None:
        Range.__post_init__(self)  # super() does not know classes with slots
        whole(f"{self.label}: control_points", self.control_points, least=1)
        one_of(f"{self.label}: interpolation", self.interpolation, INTERPOLATIONS)
        if self.hold is not None:
            positive(f"{self.label}: hold", self.hold)
        if self.free is not None:
            instance(f"{self.label}: free", self.free, Freedom, "Freedom(max_control_points, min_interval)")
            if self.control_points > (most := self.free.max_control_points):
                raise SpecError(
                    f"{self.label}: {self.control_points} control points are more than free allows: state "
                    f"control_points of at most {most}, or a larger max_control_points"
                )


@dataclass(frozen=True, slots=True)
class ParameterRange(Range):
    """One searched parameter or initial state: a single number.

    Attributes:
        name: the parameter's name in the model.
        low: lower bound in the parameter's unit; the next allowed number, unless reals are.
        high: upper bound.
        unit: its unit, empty if unknown.
        description: its meaning, from the model.
        kind: type of its value; every type except real has integer values.
        items: names and numbers of an enumeration's items.
        scale: ``log`` if it is searched evenly in decades, for which low must be positive.
        nominal: its value if it is not searched, if known.

    Raises:
        SpecError: if the bounds are not finite, in the wrong order or without an allowed number between them,
            or the scale is not for them.
    """

    _: KW_ONLY
    nominal: float | None = None


def nearest_value(ranged: Range, value: float) -> float:
    """Return the nearest number that an input or parameter can take; for reals, the value itself."""
    return value if ranged.kind == "real" else float(nearest_numbers(ranged, value))


def nearest_numbers(ranged: Range, values: ArrayLike) -> NDArray[np.float64]:
    """Return the nearest numbers that an input or parameter without reals can take, in the same shape."""
    given = np.asarray(values, dtype=np.float64)
    if not ranged.items:
        return np.clip(np.rint(given), ranged.low, ranged.high) + 0.0  # nowhere -0
    numbers = np.array(ranged.numbers, dtype=np.float64)
    return np.asarray(numbers[np.abs(given[..., None] - numbers).argmin(axis=-1)])


def into_range(value: float, ranged: Range) -> float:
    """Return the nearest number within a range that an input or parameter can take."""
    return nearest_value(ranged, min(max(float(value), ranged.low), ranged.high))


def is_outside(ranged: Range, value: float) -> bool:
    """Whether a value is farther outside a range than a rounding."""
    if ranged.kind != "real":  # whatever is nearest to an allowed number is rounded to it
        return not ranged.low - 0.5 <= value <= ranged.high + 0.5
    return not ranged.at(-_ROUNDING_SHARE) <= value <= ranged.at(1.0 + _ROUNDING_SHARE)


def outside_text(ranged: Range) -> str:
    """Say of a value that it is outside a range."""
    return f"outside its range [{ranged.low:.12g}, {ranged.high:.12g}]"
