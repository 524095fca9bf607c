"""Which formulas follow from others, by comparing their structure; some that do follow are not found."""

from functools import lru_cache

from falsifier.stl import formula as stl
from falsifier.stl.expression import Expression, Number

# Comparisons that bound an expression from one side.
_BOUNDING = ("<", "<=", ">", ">=")


@lru_cache(maxsize=10_000)  # the same parts are compared again and again
def implies(first: stl.Formula, second: stl.Formula) -> bool:
    """Whether every trajectory that satisfies the first formula certainly satisfies the second.

    >>> from falsifier.stl import parse
    >>> implies(parse("G[0,10] (x <= 3)"), parse("G[2,5] (x <= 4)"))
    True
    """
    first, second = _plain(first), _plain(second)
    return first == second or _by_parts(first, second) or _by_operator(first, second)


def _by_parts(first: stl.Formula, second: stl.Formula) -> bool:
    """Compare a whole formula with the operands of the other."""
    if isinstance(second, stl.And):
        return implies(first, second.left) and implies(first, second.right)
    if isinstance(first, stl.Or):
        return implies(first.left, second) and implies(first.right, second)
    if isinstance(first, stl.And) and (implies(first.left, second) or implies(first.right, second)):
        return True
    if isinstance(second, stl.Or):
        return implies(first, second.left) or implies(first, second.right)
    if isinstance(second, stl.Implies):
        return implies(first, second.right) or implies(first, stl.Not(second.left))
    return False


def _by_operator(first: stl.Formula, second: stl.Formula) -> bool:
    match first, second:
        case stl.Predicate(), stl.Predicate():
            return _stricter(first, second)
        case stl.Not(a), stl.Not(b):
            return implies(b, a)
        case stl.Implies(a, b), stl.Implies(c, d):
            return implies(c, a) and implies(b, d)
        case stl.Always(a, outer), stl.Always(b, inner):
            return _covers(outer, inner) and implies(a, b)
        case stl.Eventually(a, inner), stl.Eventually(b, outer):
            return _covers(outer, inner) and implies(a, b)
        case stl.Always(a, outer), stl.Eventually(b, inner):
            return _meet(outer, inner) and implies(a, b)
        case stl.Until(a, b, inner), stl.Until(c, d, outer):
            return _covers(outer, inner) and implies(a, c) and implies(b, d)
        case stl.Until(_, b, inner), stl.Eventually(d, outer):
            return _covers(outer, inner) and implies(b, d)
        case stl.Next(a), stl.Next(b):
            return implies(a, b)
    return False


def _plain(formula: stl.Formula) -> stl.Formula:
    """Return a formula without a negation in front that can be avoided or moved inwards."""
    match formula:
        case stl.Not(stl.Not(operand)):
            return _plain(operand)
        case stl.Not(stl.Predicate(operator, left, right)) if operator in _BOUNDING:
            return stl.Predicate(stl.OPPOSITE[operator], left, right)
        case stl.Not(stl.Always(operand, window)):
            return stl.Eventually(stl.Not(operand), window)
        case stl.Not(stl.Eventually(operand, window)):
            return stl.Always(stl.Not(operand), window)
    return formula


def _stricter(first: stl.Predicate, second: stl.Predicate) -> bool:
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


def _bounded(predicate: stl.Predicate) -> tuple[Expression, stl.Comparison, float] | None:
    if predicate.operator not in _BOUNDING:
        return None
    if isinstance(predicate.right, Number):
        return predicate.left, predicate.operator, predicate.right.value
    if isinstance(predicate.left, Number):
        return predicate.right, stl.MIRRORED[predicate.operator], predicate.left.value
    return None


def _covers(outer: stl.Window | None, inner: stl.Window | None) -> bool:
    if outer is None or inner is None:
        return outer is None
    return outer.start <= inner.start and inner.end <= outer.end


def _meet(one: stl.Window | None, other: stl.Window | None) -> bool:
    return one is None or other is None or max(one.start, other.start) <= min(one.end, other.end)
