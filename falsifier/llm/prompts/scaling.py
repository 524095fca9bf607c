"""Neutral scales: numbers between 0 and 1 without units; ``disguise`` states the rules."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from falsifier.core.space import InputRange, ParameterRange, nearest_value
from falsifier.stl.expression import Name, Number
from falsifier.stl.formula import Formula, Predicate

# What a derived signal is compared with, and half of the interval to which a usual range is mapped.
MIDDLE, _HALF = 0.5, 0.3
# Never a power of ten together with a round number: 80 * 1.25 would leave the digits of all others.
_HEADROOM = 1.3
# A declared range that is this much wider than the known values says nothing of how far the signal goes.
_VAGUE = 1000.0
# Maximum number of decimals of scaled values that were searched.
_DECIMALS = 12
# Levels that are listed; an integer with more of them is told as a plain number.
_MOST_LEVELS = 12


@dataclass(frozen=True, slots=True)
class Scale:
    """A linear map of the usual values of a signal to 0.2 to 0.8.

    Attributes:
        middle: what becomes 0.5.
        reach: distance from it to the ends of the usual values; 0: not known yet.
    """

    middle: float = 0.0
    reach: float = 0.0

    @classmethod
    def of(cls, known: Sequence[float], declared: tuple[float, float] | None) -> "Scale":
        """The scale that follows from numbers that matter for a signal, and from its declared range."""
        values = [n for n in known if np.isfinite(n)]
        low, high = (min(values), max(values)) if values else (0.0, 0.0)
        if declared is not None:
            width = declared[1] - declared[0]
            if np.isfinite(width) and width > 0 and (not values or width <= _VAGUE * (high - low or np.inf)):
                return cls(sum(declared) / 2, width / 2)
        return cls((low + high) / 2, _HEADROOM * (high - low) / 2)

    def fitted(self, column: NDArray[np.float64], *, has_middle: bool) -> "Scale":
        """The scale that a first trajectory determines, if it is not known."""
        if self.reach or not column.size or not np.isfinite(column).all():
            return self
        least, most = float(column.min()), float(column.max())
        middle = self.middle if has_middle else (least + most) / 2
        return Scale(middle, _HEADROOM * max(most - middle, middle - least))

    def of_values(self, values: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Scaled values."""
        distance = (np.asarray(values, dtype=np.float64) - self.middle) / (self.reach or 1.0)
        return np.asarray(MIDDLE + _HALF * distance)

    def number(self, value: float) -> float:
        """A scaled number."""
        return float(self.of_values(value))


def hidden_value(ranged: InputRange | ParameterRange, value: float) -> float:
    """A searched value between 0 and 1."""
    span = ranged.high - ranged.low
    return round((value - ranged.low) / span, _decimals(ranged)) if span else 0.0


def _decimals(ranged: InputRange | ParameterRange) -> int:
    """So many that a value comes back as it went: a narrow range far from 0 has fewer."""
    noise = 8 * np.finfo(float).eps * max(abs(ranged.low), abs(ranged.high)) / (ranged.high - ranged.low)
    return int(np.clip(-np.log10(noise) - 1, 0, _DECIMALS)) if noise else _DECIMALS


def real_value(ranged: InputRange | ParameterRange, value: float) -> float:
    """The value that can be simulated; the limits come back exactly."""
    if value in (0.0, 1.0):
        found = ranged.low if value == 0.0 else ranged.high
    else:
        found = ranged.low + value * (ranged.high - ranged.low)
    return nearest_value(ranged, min(max(found, ranged.low), ranged.high))


def levels(ranged: InputRange | ParameterRange) -> tuple[float, ...]:
    """The scaled values that something discrete can take; empty for reals and if there are many."""
    if ranged.kind == "real" or ranged.high - ranged.low > 1000:
        return ()
    whole = np.arange(np.ceil(ranged.low), np.floor(ranged.high) + 1)
    found = sorted({nearest_value(ranged, float(n)) for n in whole})
    return tuple(round(hidden_value(ranged, n), 6) for n in found) if len(found) <= _MOST_LEVELS else ()


def compared_numbers(formula: Formula, name: str) -> list[float]:
    """The numbers with which a signal alone is compared."""
    return [n for p in formula.predicates if keeps_form(p) and _signals(p) == (name,) for n in _numbers(p)]


def keeps_form(predicate: Predicate) -> bool:
    """Whether a predicate is told in its own form, not as a derived signal."""
    return len(_signals(predicate)) == 1 and all(
        isinstance(side, Name | Number) for side in (predicate.left, predicate.right)
    )


def margin(predicate: Predicate, columns: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Left side minus right side."""
    return np.asarray(predicate.left.evaluate(columns) - predicate.right.evaluate(columns))


def with_predicates(formula: Formula, predicates: Mapping[Predicate, Predicate]) -> Formula:
    """The formula with other predicates."""
    if isinstance(formula, Predicate):
        return predicates[formula]
    parts = (getattr(formula, field.name) for field in fields(formula))  # type: ignore[arg-type]
    return type(formula)(*(with_predicates(p, predicates) if isinstance(p, Formula) else p for p in parts))


def _signals(predicate: Predicate) -> tuple[str, ...]:
    return (*predicate.left.signals, *predicate.right.signals)


def _numbers(predicate: Predicate) -> list[float]:
    found = (e for side in (predicate.left, predicate.right) for e in side.walk())
    return [e.value for e in found if isinstance(e, Number)]
