"""Which formulas follow from others, by comparing their structure; some that do follow are not found."""

from functools import lru_cache

from falsifier.stl.expression import Expression, Number
from falsifier.stl.formula import (
    MIRRORED,
    OPPOSITE,
    Always,
    And,
    Comparison,
    Eventually,
    Formula,
    Implies,
    Next,
    Not,
    Or,
    Predicate,
    Until,
    Window,
)

# Comparisons that bound an expression from one side.
_BOUNDING = ("<", "<=", ">", ">=")


@lru_cache(maxsize=10_000)  # the same parts are compared again and again
def implies(first: Formula, second: Formula) -> bool:
    """Whether every trajectory that satisfies the first formula certainly satisfies the second.

    >>> from falsifier.stl import parse
    >>> implies(parse("G[0,10] (x <= 3)"), parse("G[2,5] (x <= 4)"))
    True
    """
    first, second = _plain(first), _plain(second)
    if first == second:
        return True
    return _by_parts(first, second) or _by_operator(first, second)


def _by_parts(first: Formula, second: Formula) -> bool:
    """Compare a whole formula with the operands of the other."""
    if isinstance(second, And):
        return implies(first, second.left) and implies(first, second.right)
    if isinstance(first, Or):
        return implies(first.left, second) and implies(first.right, second)
    if isinstance(first, And) and (implies(first.left, second) or implies(first.right, second)):
        return True
    if isinstance(second, Or):
        return implies(first, second.left) or implies(first, second.right)
    if isinstance(second, Implies):
        return implies(first, second.right) or implies(first, Not(second.left))
    return False


def _by_operator(first: Formula, second: Formula) -> bool:
    match first, second:
        case Predicate(), Predicate():
            return _stricter(first, second)
        case Not(a), Not(b):
            return implies(b, a)
        case Implies(a, b), Implies(c, d):
            return implies(c, a) and implies(b, d)
        case Always(a, outer), Always(b, inner):
            return _covers(outer, inner) and implies(a, b)
        case Eventually(a, inner), Eventually(b, outer):
            return _covers(outer, inner) and implies(a, b)
        case Always(a, outer), Eventually(b, inner):
            return _meet(outer, inner) and implies(a, b)
        case Until(a, b, inner), Until(c, d, outer):
            return _covers(outer, inner) and implies(a, c) and implies(b, d)
        case Until(_, b, inner), Eventually(d, outer):
            return _covers(outer, inner) and implies(b, d)
        case Next(a), Next(b):
            return implies(a, b)
    return False


def _plain(formula: Formula) -> Formula:
    """Return a formula without a negation in front that can be avoided or moved inwards."""
    match formula:
        case Not(Not(operand)):
            return _plain(operand)
        case Not(Predicate(operator, left, right)) if operator in _BOUNDING:
            return Predicate(OPPOSITE[operator], left, right)
        case Not(Always(operand, window)):
            return Eventually(Not(operand), window)
        case Not(Eventually(operand, window)):
            return Always(Not(operand), window)
    return formula


def _stricter(first: Predicate, second: Predicate) -> bool:
    """Whether one comparison of an expression with a number follows from another."""
    a, b = _bounded(first), _bounded(second)
    if a is None or b is None or a[0] != b[0]:
        return False
    (_, one, low), (_, two, high) = a, b
    if one[0] != two[0]:
        return False
    if low == high:
        return one == two or two.endswith("=")
    return low < high if one[0] == "<" else low > high


def _bounded(predicate: Predicate) -> tuple[Expression, Comparison, float] | None:
    if predicate.operator not in _BOUNDING:
        return None
    if isinstance(predicate.right, Number):
        return predicate.left, predicate.operator, predicate.right.value
    if isinstance(predicate.left, Number):
        return predicate.right, MIRRORED[predicate.operator], predicate.left.value
    return None


def _covers(outer: Window | None, inner: Window | None) -> bool:
    if outer is None or inner is None:
        return outer is None
    return outer.start <= inner.start and inner.end <= outer.end


def _meet(one: Window | None, other: Window | None) -> bool:
    if one is None or other is None:
        return True
    return max(one.start, other.start) <= min(one.end, other.end)
