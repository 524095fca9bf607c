"""Neutral scales: numbers between 0 and 1 without units, and a formula over them.

The rules, for signals and for what a requirement says of them:

- What is searched runs from 0 to 1: its range is mapped linearly. Integers, Booleans and enumerations become
  levels between 0 and 1.
- Every other signal has a usual range, which is mapped linearly to 0.2 to 0.8. Beyond it, values approach 0
  and 1, so that none is ever outside, however far a signal goes. Integers are mapped like reals.
- The usual range is the one that the model declares (min and max), else that of all numbers that predicates
  compare the signal with and of its start values, widened by 1.3, so that the digits of the original do not
  stay. All of this is known before the first question. If it is a single number, that is 0.5 from the first
  question on, and the largest distance from it in the first trajectory determines how wide the range is.
- A predicate that compares one signal with a number keeps its form. Any other one is replaced by a derived
  signal that is compared with 0.5: its left side minus its right side, scaled as a signal of its own. Its
  coefficients would give the system away, and a sum of scaled signals is not the scaled sum. Derived signals
  with the same unit share their usual range, so that the robustness of several parts can be compared.

Scales do not change during a run. Robustness is that of the scaled formula. Its sign is that of the original
one.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.core.space import InputRange, ParameterRange, nearest_value
from falsifier.stl.expression import Arithmetic, Call, Expression, Name, Negative, Number
from falsifier.stl.formula import Formula, Predicate

# Never a power of ten together with a round number: 80 * 1.25 would leave the digits of all others.
_HEADROOM = 1.3
# Half of the interval to which the usual range of a signal is mapped.
_LINEAR = 0.3
_MIDDLE = 0.5
# A declared range that is this much wider than the known values says nothing of how far the signal goes.
_VAGUE = 1000.0
# Significant digits of numbers in a formula.
_DIGITS = 9
# Maximum number of decimals of scaled values that were searched.
_DECIMALS = 12
_COMPARABLE_FUNCTIONS = ("abs", "min", "max")
# Levels that are listed; an integer with more of them is told as a plain number.
_MOST_LEVELS = 12


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


@dataclass(frozen=True, slots=True)
class Scale:
    """An increasing map of all numbers to those between 0 and 1, linear around its middle.

    Attributes:
        middle: what becomes 0.5.
        reach: distance from the middle up to which the map is linear.
    """

    middle: float = 0.0
    reach: float = 1.0

    @classmethod
    def over(cls, low: float, high: float) -> "Scale":
        """The scale that is linear in a range."""
        return cls((low + high) / 2, (high - low) / 2)

    def of(self, values: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Scaled values."""
        distance = (np.asarray(values, dtype=np.float64) - self.middle) / self.reach
        beyond = np.maximum(np.abs(distance) - 1.0, 0.0)
        rest = _MIDDLE - _LINEAR
        # Of the same slope as the linear part where it begins.
        size = np.where(
            beyond > 0, _MIDDLE - rest / (1.0 + _LINEAR / rest * beyond), _LINEAR * np.abs(distance)
        )
        return np.asarray(_MIDDLE + np.copysign(size, distance))

    def number(self, value: float) -> float:
        """A scaled number."""
        return float(self.of(value))


@dataclass(frozen=True)
class Scales:
    """How signals are scaled.

    Attributes:
        groups: signals that share a scale.
        known: smallest and largest number that is known of a group before anything was simulated.
        found: scales that are settled.
    """

    groups: tuple[frozenset[str], ...]
    known: Mapping[frozenset[str], tuple[float, float]] = field(default_factory=dict)
    found: Mapping[frozenset[str], Scale] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        numbers: Mapping[str, Sequence[float]],
        units: Mapping[str, str],
        declared: Mapping[str, tuple[float, float]],
    ) -> "Scales":
        """Scales from what is known before a simulation.

        Args:
            numbers: numbers that matter for a signal: those it is compared with, its start values; by name,
                of all signals.
            units: units by name.
            declared: smallest and largest value that the model declares, by name.
        """
        joined = [
            {a, b} for a, b in combinations(numbers, 2) if units.get(a) and units.get(a) == units.get(b)
        ]
        groups = _united([{name} for name in numbers], joined)
        known, found = {}, {}
        for group in groups:
            values = [n for name in group for n in numbers[name] if np.isfinite(n)]
            if values:
                known[group] = min(values), max(values)
            ends = [end for name in group if name in declared for end in declared[name]]
            if group <= declared.keys() and _is_telling(
                low := min(ends), high := max(ends), known.get(group)
            ):
                found[group] = Scale.over(low, high)
        return cls(groups, known, found)

    def fitted(self, columns: Mapping[str, NDArray[np.float64]]) -> "Scales":
        """Scales that are settled now, given the first trajectory."""
        found = dict(self.found)
        for group in self.groups:
            low, high = self.known.get(group, (np.nan, np.nan))
            if group in found or low < high:
                continue
            seen = [columns[name] for name in sorted(group) if name in columns and columns[name].size]
            if not seen or not all(np.isfinite(column).all() for column in seen):
                continue
            least, most = min(float(c.min()) for c in seen), max(float(c.max()) for c in seen)
            middle = (least + most) / 2 if np.isnan(low) else low
            if reach := max(most - middle, middle - least):
                found[group] = Scale(middle, _HEADROOM * reach)
        return replace(self, found=found)

    def __getitem__(self, name: str) -> Scale:
        group = next((g for g in self.groups if name in g), frozenset[str]())
        if group in self.found:
            return self.found[group]
        low, high = self.known.get(group, (0.0, 0.0))
        return Scale((low + high) / 2, _HEADROOM * (high - low) / 2 if low < high else 1.0)


def _is_telling(low: float, high: float, known: tuple[float, float] | None) -> bool:
    """Whether a declared range says how far signals go."""
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        return False
    return known is None or high - low <= _VAGUE * (known[1] - known[0] or np.inf)


def compared_numbers(formula: Formula, name: str) -> list[float]:
    """The numbers with which a signal alone is compared."""
    return [n for p in formula.predicates if keeps_form(p) and _names(p) == (name,) for n in _numbers(p)]


def are_comparable(predicate: Predicate) -> bool:
    """Whether left minus right side has the unit of the signals in both."""
    sides = (predicate.left, predicate.right)
    return all(
        isinstance(part, Name | Number | Negative)
        or (isinstance(part, Arithmetic) and part.operator in ("+", "-"))
        or (isinstance(part, Call) and part.function in _COMPARABLE_FUNCTIONS)
        for side in sides
        for part in side.walk()
    )


def signed_names(predicate: Predicate) -> tuple[tuple[str, str], ...]:
    """Signals of left minus right side with their signs, numbers left out; empty if it is more than a sum."""
    terms = [*_terms(predicate.left, "+"), *_terms(predicate.right, "-")]
    return () if any(sign == "" for sign, _ in terms) else tuple(terms)


def _terms(expression: Expression, sign: str) -> list[tuple[str, str]]:
    other = {"+": "-", "-": "+"}[sign]
    match expression:
        case Name():
            return [(sign, expression.name)]
        case Number():
            return []
        case Negative():
            return _terms(expression.operand, other)
        case Arithmetic(operator=("+" | "-") as operator):
            right = sign if operator == "+" else other
            return [*_terms(expression.left, sign), *_terms(expression.right, right)]
    return [("", "")]


def keeps_form(predicate: Predicate) -> bool:
    """Whether a predicate is told in its own form, not as a derived signal."""
    return len(_names(predicate)) == 1 and all(
        isinstance(side, Name | Number) for side in (predicate.left, predicate.right)
    )


def scaled_predicate(predicate: Predicate, scaled: Callable[[float], float], name: str) -> Predicate:
    """A predicate that keeps its form, over a scaled signal with another name."""

    def number(value: float) -> float:
        return float(f"{scaled(value):.{_DIGITS}g}")

    return _mapped(predicate, lambda _: name, number)  # type: ignore[no-any-return]


def margin(predicate: Predicate, columns: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Left side minus right side."""
    return np.asarray(predicate.left.evaluate(columns) - predicate.right.evaluate(columns))


def with_predicates(formula: Formula, predicates: Mapping[Predicate, Predicate]) -> Formula:
    """The formula with other predicates."""
    if isinstance(formula, Predicate):
        return predicates[formula]
    parts = (getattr(formula, field.name) for field in fields(formula))  # type: ignore[arg-type]
    return type(formula)(*(with_predicates(p, predicates) if isinstance(p, Formula) else p for p in parts))


def _names(predicate: Predicate) -> tuple[str, ...]:
    return (*predicate.left.signals, *predicate.right.signals)


def _numbers(predicate: Predicate) -> list[float]:
    found = (e for side in (predicate.left, predicate.right) for e in side.walk())
    return [e.value for e in found if isinstance(e, Number)]


def _united(groups: Sequence[set[str]], joined: Sequence[set[str]]) -> tuple[frozenset[str], ...]:
    """Groups, where all that have a member in a common set are one."""
    found = [set(group) for group in groups]
    for names in joined:
        touched = [group for group in found if group & names]
        found = [group for group in found if not group & names] + [set().union(*touched)]
    return tuple(frozenset(group) for group in found if group)


def _mapped(node: Any, name: Callable[[str], str], number: Callable[[float], float]) -> Any:
    if isinstance(node, Name):
        return Name(name(node.name))
    if isinstance(node, Number):
        return Number(number(node.value))
    if isinstance(node, tuple):
        return tuple(_mapped(part, name, number) for part in node)
    if isinstance(node, Predicate | Negative | Arithmetic | Call):
        return type(node)(*(_mapped(getattr(node, f.name), name, number) for f in fields(node)))
    return node
