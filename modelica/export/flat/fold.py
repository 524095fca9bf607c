"""Constructors of scalar expressions that compute constant expressions immediately."""

from __future__ import annotations

import math
from collections.abc import Callable

from ..read.syntax import LARGEST_INTEGER, ExportError, Place
from .ir import NUMBERS, Cond, Lit, Op, Relation, Scalar, Type, alike

COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b,
    "<>": lambda a, b: a != b,
}


REAL_FUNCTIONS: dict[str, Callable[..., float]] = {
    "sqrt": math.sqrt,
    "exp": math.exp,
    "log": math.log,
    "log10": math.log10,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
    "atan2": math.atan2,
    "sinh": math.sinh,
    "cosh": math.cosh,
    "tanh": math.tanh,
}


def real(value: float) -> Lit:
    """A Real literal."""
    return Lit(float(value), "Real")


def _joined(args: tuple[Scalar, ...], place: Place, name: str) -> Type:
    types = {arg.type for arg in args}
    if others := sorted(types - NUMBERS):
        raise ExportError(place, f"'{name}' expects numbers, not {others[0]}")
    return "Integer" if types == {"Integer"} else "Real"


def arithmetic(name: str, args: tuple[Scalar, ...], place: Place) -> Scalar:
    """`+ - * / ^ neg` and min, max, abs, sign, div, mod, rem of numbers, without events."""
    kind = _joined(args, place, name)
    if name in ("/", "^"):
        kind = "Real"
    if name == "sign":
        kind = "Integer"
    if not all(isinstance(arg, Lit) for arg in args):
        return Op(name, args, kind)
    values = [arg.value for arg in args if isinstance(arg, Lit)]
    try:
        result = _compute(name, values)
    except (ZeroDivisionError, OverflowError, ValueError) as error:
        raise ExportError(
            place, f"'{name}' of {', '.join(map(str, values))} cannot be computed: {error}"
        ) from None
    if kind == "Integer" and not -LARGEST_INTEGER <= result <= LARGEST_INTEGER:
        raise ExportError(place, f"{int(result)} is too large for an Integer, which has 32 bits")
    return Lit(float(result) if kind == "Real" else int(result), kind)


def _compute(name: str, values: list[float]) -> float:
    match name, values:
        case "+", [a, b]:
            return a + b
        case "-", [a, b]:
            return a - b
        case "*", [a, b]:
            return a * b
        case "/", [a, b]:
            return a / b
        case "^", [a, b]:
            return float(math.pow(a, b))
        case "neg", [a]:
            return -a
        case "min", _:
            return min(values)
        case "max", _:
            return max(values)
        case "abs", [a]:
            return abs(a)
        case "sign", [a]:
            return (a > 0) - (a < 0)
        case "floor", [a]:
            return math.floor(a)
        case "ceil", [a]:
            return math.ceil(a)
        case "div", [a, b]:
            return math.trunc(a / b)
        case "mod", [a, b]:
            return a - math.floor(a / b) * b
        case "rem", [a, b]:
            return a - math.trunc(a / b) * b
    raise ValueError(name)


def function(name: str, args: tuple[Scalar, ...], place: Place) -> Scalar:
    """An elementary function of Reals."""
    _joined(args, place, name)
    values = [arg.value for arg in args if isinstance(arg, Lit)]
    if len(values) < len(args):
        return Op(name, args, "Real")
    try:
        return real(REAL_FUNCTIONS[name](*values))
    except (ValueError, OverflowError) as error:
        raise ExportError(place, f"{name}({', '.join(map(str, values))}): {error}") from None


def floor_free(arg: Scalar, place: Place) -> Scalar:
    """Floor without events."""
    return arithmetic("floor", (arg,), place)


def logic(name: str, args: tuple[Scalar, ...], place: Place) -> Scalar:
    """and, or, not."""
    if any(arg.type != "Boolean" for arg in args):
        raise ExportError(place, f"'{name}' needs Booleans")
    if name == "not":
        return Lit(not args[0].value, "Boolean") if isinstance(args[0], Lit) else Op("not", args, "Boolean")
    left, right = args
    for one, other in ((left, right), (right, left)):
        if isinstance(one, Lit):
            if name == "and":
                return other if one.value else one
            return one if one.value else other
    return Op(name, args, "Boolean")


def comparison(name: str, left: Scalar, right: Scalar, place: Place, *, events: bool) -> Scalar:
    """A relation; with `events`, a comparison of Reals is frozen between events."""
    if not alike(left.type, right.type):
        raise ExportError(place, f"'{name}' compares {left.type} with {right.type}")
    if isinstance(left, Lit) and isinstance(right, Lit):
        return Lit(COMPARISONS[name](left.value, right.value), "Boolean")
    reals = "Real" in (left.type, right.type)
    if reals and name in ("==", "<>"):
        raise ExportError(place, f"'{name}' between Reals is only possible in functions")
    if reals and events:
        return Relation(name, left, right)
    return Op(name, (left, right), "Boolean")


def choose(condition: Scalar, then: Scalar, otherwise: Scalar, place: Place) -> Scalar:
    """An if-expression."""
    if condition.type != "Boolean":
        raise ExportError(place, "the condition after 'if' must be Boolean")
    if not alike(then.type, otherwise.type):
        raise ExportError(place, "the branches of 'if' have different types")
    if isinstance(condition, Lit):
        return then if condition.value else otherwise
    kind: Type = then.type if then.type == otherwise.type else "Real"
    return Cond(condition, then, otherwise, kind)
