"""Neutral scales: numbers without units, and a formula over them.

The rules, for signals and for what a requirement says of them:

- What is searched runs from 0 to 1: its range is mapped linearly. Integers, Booleans and enumerations become
  levels between 0 and 1.
- Every other signal is divided by a constant. Signals that one predicate compares or adds share it, and so do
  signals with the same unit: their differences keep their meaning. The constant is the largest number that
  predicates compare these signals with, else their largest start value, else the largest value in the first
  trajectory; times 1.3, so that the digits of the original do not stay.
- A predicate keeps its form if it adds, subtracts, or takes absolute values, minima and maxima of such
  signals and of numbers: its numbers are divided by the same constant. A predicate that compares one
  searched signal with a number keeps its form too, in the scale of that signal.
- Any other predicate (products, quotients, powers, functions; searched signals together with others) is
  replaced by a derived signal that is compared with 0: its left side minus its right side, scaled as a
  signal of its own. Its coefficients would give the system away, and a function of scaled signals is
  not the scaled function.

Robustness is that of the scaled formula. Its sign is that of the original one.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.core.space import InputRange, ParameterRange, nearest_value
from falsifier.stl.expression import Arithmetic, Call, Expression, Name, Negative, Number
from falsifier.stl.formula import Formula, Predicate

# Never a power of ten together with a round number: 80 * 1.25 would leave the digits of all others.
_HEADROOM = 1.3
# Significant digits of numbers in a formula.
_DIGITS = 9
# Maximum number of decimals of scaled values that were searched.
_DECIMALS = 12
_KEPT_FUNCTIONS = ("abs", "min", "max")
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


@dataclass(frozen=True)
class Scales:
    """Constants by which signals are divided.

    Attributes:
        groups: signals that share a constant.
        constants: constants by signal; a signal without one has not been seen with a number yet.
    """

    groups: tuple[frozenset[str], ...]
    constants: Mapping[str, float]

    @classmethod
    def of(
        cls, formula: Formula, names: Iterable[str], units: Mapping[str, str], searched: set[str]
    ) -> "Scales":
        """Scales from the numbers in a formula.

        Args:
            formula: the requirement, in real names.
            names: all signals that are divided by a constant, derived ones included.
            units: units by name.
            searched: names of what is searched.
        """
        kept = [p for p in formula.predicates if keeps_form(p, searched) and not set(_names(p)) & searched]
        joined = [set(_names(p)) for p in kept]
        joined += [{a, b} for a, b in combinations(names, 2) if units.get(a) and units.get(a) == units.get(b)]
        groups = _united([{name} for name in names], joined)
        constants: dict[str, float] = {}
        for group in groups:
            numbers = [abs(n) for p in kept if group & set(_names(p)) for n in _numbers(p)]
            if any(numbers):
                constants |= dict.fromkeys(group, _HEADROOM * max(numbers))
        return cls(groups, constants)

    def fitted(self, largest: Mapping[str, float]) -> "Scales":
        """Scales that are known now, given the largest absolute values of signals."""
        found = dict(self.constants)
        for group in self.groups:
            size = max((largest.get(name, 0.0) for name in group), default=0.0)
            if not group & found.keys() and 0 < size < np.inf:
                found |= dict.fromkeys(group, _HEADROOM * size)
        return replace(self, constants=found)

    def __getitem__(self, name: str) -> float:
        return self.constants.get(name, 1.0)


def keeps_form(predicate: Predicate, searched: set[str]) -> bool:
    """Whether a predicate is told in its own form, not as a derived signal."""
    names, sides = set(_names(predicate)), (predicate.left, predicate.right)
    if names & searched:
        return len(names) == 1 and all(isinstance(side, Name | Number) for side in sides)
    return all(_is_plain(side) for side in sides)


def scaled_predicate(
    predicate: Predicate,
    scales: Scales,
    names: Mapping[str, str],
    searched: Mapping[str, InputRange | ParameterRange],
) -> Predicate:
    """A predicate that keeps its form, over scaled signals under other names."""
    (of, *_) = (*_names(predicate), "")
    ranged = searched.get(of)

    def number(value: float) -> float:
        scaled = (
            value / scales[of] if ranged is None else (value - ranged.low) / (ranged.high - ranged.low or 1.0)
        )
        return float(f"{scaled:.{_DIGITS}g}")

    return _mapped(predicate, lambda name: names[name], number)  # type: ignore[no-any-return]


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


def _is_plain(expression: Expression) -> bool:
    for part in expression.walk():
        if isinstance(part, Arithmetic) and part.operator not in ("+", "-"):
            return False
        if isinstance(part, Call) and part.function not in _KEPT_FUNCTIONS:
            return False
    return True


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
