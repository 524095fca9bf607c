"""``true`` and ``false`` in formulas: replaced when a formula is read, by an equivalent one without them.

Their robustness is infinite by definition, with either sign. A minimum or maximum with an infinite value is
the other value or infinite itself, so that every constant either disappears or spreads to the formula around
it. What remains has the same robustness and the same critical time, and finite values in all its parts.
"""

from dataclasses import dataclass

from falsifier.stl.formula import (
    Always,
    And,
    Eventually,
    Formula,
    Iff,
    Implies,
    Next,
    Not,
    Or,
    Predicate,
    Until,
    Window,
)


@dataclass(frozen=True, slots=True)
class Constant(Formula):
    """``true`` or ``false``; only the parser makes them, and no parsed formula contains one."""

    value: bool

    def __str__(self) -> str:
        return "true" if self.value else "false"


TRUE, FALSE = Constant(value=True), Constant(value=False)


def without_constants(formula: Formula) -> Formula:
    """Return an equivalent formula without constants, or a constant if the formula is always true or false.

    >>> from falsifier.stl import parse
    >>> print(parse("true U[0,5] (x >= 1) and not false"))
    F[0,5] (x >= 1)
    """
    match formula:
        case Predicate() | Constant():
            return formula
        case Not(operand):
            return _negated(without_constants(operand))
        case Next(operand):
            inner = without_constants(operand)
            return inner if isinstance(inner, Constant) else Next(inner)
        case Always(operand, window) | Eventually(operand, window):
            inner = without_constants(operand)
            return inner if isinstance(inner, Constant) else type(formula)(inner, window)
        case Until(left, right, window):
            return _until(without_constants(left), without_constants(right), window)
        case And(left, right) | Or(left, right) | Implies(left, right) | Iff(left, right):
            return _joined(type(formula), without_constants(left), without_constants(right))
    raise TypeError(f"not a formula: {formula!r}")


def _negated(formula: Formula) -> Formula:
    if isinstance(formula, Constant):
        return FALSE if formula.value else TRUE
    return Not(formula)


def _joined(kind: type[And | Or | Implies | Iff], left: Formula, right: Formula) -> Formula:
    if isinstance(left, Constant):
        return _beside(kind, left, right)
    if isinstance(right, Constant):
        if kind is Implies:
            return right if right.value else _negated(left)
        return _beside(kind, right, left)
    return kind(left, right)


def _beside(kind: type[And | Or | Implies | Iff], constant: Constant, other: Formula) -> Formula:
    """Return the formula with a constant as its left operand."""
    if kind is And:
        return other if constant.value else FALSE
    if kind is Or:
        return TRUE if constant.value else other
    if kind is Implies:
        return other if constant.value else TRUE
    return other if constant.value else _negated(other)


def _until(left: Formula, right: Formula, window: Window | None) -> Formula:
    if isinstance(left, Constant):
        if isinstance(right, Constant) or not left.value:
            return right if left.value else FALSE
        return Eventually(right, window)
    if isinstance(right, Constant):
        if not right.value:
            return right
        # The earliest time is the best one for the right operand; the left one must hold up to then.
        return Always(left, Window(0.0, window.start)) if window and window.start > 0 else left
    return Until(left, right, window)
