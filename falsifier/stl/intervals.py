"""What formulas can be worth if each signal keeps to a range: interval arithmetic.

The bounds are safe and not always tight: each occurrence of a signal is taken for a signal of its own.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from operator import mul, truediv

from falsifier.stl.expression import Arithmetic, Call, Expression, Name, Negative, Number
from falsifier.stl.formula import (
    And,
    Formula,
    Iff,
    Implies,
    Next,
    Not,
    Or,
    Predicate,
    Temporal,
    Until,
    replaced,
)
from falsifier.stl.margins import ON_LIMIT, on_limit


@dataclass(frozen=True, slots=True)
class Interval:
    """All numbers from low to high, which may be infinite."""

    low: float = -math.inf
    high: float = math.inf

    def __neg__(self) -> "Interval":
        return Interval(-self.high, -self.low)

    def __add__(self, other: "Interval") -> "Interval":
        low, high = self.low + other.low, self.high + other.high
        return Interval(-math.inf if math.isnan(low) else low, math.inf if math.isnan(high) else high)

    def __sub__(self, other: "Interval") -> "Interval":
        return self + -other


_ANY = Interval()
_MONOTONE = {"exp": math.exp, "sqrt": math.sqrt, "log": math.log}


def values(expression: Expression, ranges: Mapping[str, Interval]) -> Interval:
    """Return bounds of an expression; signals without a range may have any value."""
    match expression:
        case Number(value):
            return Interval(value, value)
        case Name(name):
            return ranges.get(name, _ANY)
        case Negative(operand):
            return -values(operand, ranges)
        case Arithmetic(operator, left, right):
            return _arithmetic(operator, values(left, ranges), values(right, ranges))
        case Call(function, operands):
            return _call(function, [values(operand, ranges) for operand in operands])
    return _ANY


def margins(formula: Formula, ranges: Mapping[str, Interval]) -> Interval:
    """Return bounds of a formula's robustness at any time."""
    if isinstance(formula, Predicate):
        found = values(formula.left, ranges) - values(formula.right, ranges)
        if formula.operator in ("==", "!="):
            found = _absolute(found)
        if formula.operator in ("<", "<=", "=="):
            found = -found
        at_zero = on_limit(formula.operator)
        return Interval(found.low or at_zero, found.high or at_zero)
    parts = [margins(child, ranges) for child in formula.children]
    match formula:
        case Not():
            return -parts[0]
        case And() | Until():
            return _smallest(parts)
        case Or():
            return _largest(parts)
        case Implies():
            return _largest([-parts[0], parts[1]])
        case Iff():
            left, right = parts
            return _smallest([_largest([-left, right]), _largest([-right, left])])
    if isinstance(formula, Next | Temporal):
        return parts[0]
    raise TypeError(f"not a formula: {formula!r}")


def decided(formula: Formula, ranges: Mapping[str, Interval]) -> Iterator[tuple[Formula, bool]]:
    """Yield the largest parts that hold for all trajectories in range, or for none, and which of the two."""
    found = margins(formula, ranges)
    if found.low > 0 or found.high < 0:
        yield formula, found.low > 0
    else:
        for child in formula.children:
            yield from decided(child, ranges)


def without_equality(formula: Formula) -> Formula | None:
    """Return the same for whole numbers with margins in place of == and !=, if that gives violations one.

    >>> from falsifier.stl import parse
    >>> without_equality(parse("G (gear == 3 -> speed <= 9)"))
    parse('G (abs(gear - 3) <= 0.5 -> speed <= 9)')
    >>> without_equality(parse("G (speed <= 9 -> gear == 3)"))
    """
    if margins(formula, {}).low != -ON_LIMIT:
        return None
    parts = {p: _tolerant(p) for p in formula.predicates if p.operator in ("==", "!=")}
    tolerant = replaced(formula, parts)
    return tolerant if margins(tolerant, {}).low < -ON_LIMIT else None


def _tolerant(equal: Predicate) -> Predicate:
    distance = Call("abs", (Arithmetic("-", equal.left, equal.right),))
    return Predicate("<=" if equal.operator == "==" else ">", distance, Number(0.5))


def _smallest(parts: list[Interval]) -> Interval:
    return Interval(min(p.low for p in parts), min(p.high for p in parts))


def _largest(parts: list[Interval]) -> Interval:
    return Interval(max(p.low for p in parts), max(p.high for p in parts))


def _absolute(x: Interval) -> Interval:
    if x.low >= 0:
        return x
    return -x if x.high <= 0 else Interval(0.0, max(-x.low, x.high))


def _arithmetic(operator: str, left: Interval, right: Interval) -> Interval:
    if operator == "+":
        return left + right
    if operator == "-":
        return left - right
    if operator == "*":
        return _corners(left, right)
    if operator == "/" and (right.low > 0 or right.high < 0):
        return _corners(left, right, truediv)
    if operator == "^" and right == Interval(2.0, 2.0):
        size = _absolute(left)
        return _corners(size, size)
    return _ANY


def _corners(left: Interval, right: Interval, combine: Callable[[float, float], float] = mul) -> Interval:
    found = [combine(a, b) for a in (left.low, left.high) for b in (right.low, right.high)]
    known = [0.0 if math.isnan(x) else x for x in found]  # of 0 and an infinite end, or of two
    return Interval(min(known), max(known))


def _call(function: str, operands: list[Interval]) -> Interval:
    first = operands[0]
    if function == "abs":
        return _absolute(first)
    if function == "min":
        return _smallest(operands)
    if function == "max":
        return _largest(operands)
    if function in ("sin", "cos"):
        return Interval(-1.0, 1.0)
    try:
        return Interval(_MONOTONE[function](first.low), _MONOTONE[function](first.high))
    except (ValueError, OverflowError):
        return _ANY
