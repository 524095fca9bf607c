"""Units in formulas: what is compared or added should have the same one."""

from collections.abc import Iterator

from falsifier.core.model import ModelInfo
from falsifier.fmu.units import conversion
from falsifier.stl import Formula
from falsifier.stl.expression import Arithmetic, Call, Expression, Name, Negative, Number
from falsifier.stl.formula import Predicate

# Functions whose value has the unit of their operands.
_KEEPING = ("abs", "min", "max")


def unit_conflicts(formula: Formula, info: ModelInfo) -> Iterator[tuple[Predicate, str]]:
    """Yield each comparison whose units do not fit, and what is wrong with it.

    Numbers fit any unit. Products and quotients are not judged: a factor may convert units.
    """
    for predicate in formula.predicates:
        for part in (*predicate.left.walk(), *predicate.right.walk()):
            yield from ((predicate, text) for text in _conflict(part, info))
        yield from ((predicate, text) for text in _compared(predicate.left, predicate.right, info))


def unit_of(expression: Expression, info: ModelInfo) -> str:
    """Return the unit of an expression; empty if it is not known."""
    match expression:
        case Name(name):
            return info[name].unit if name in info else ""
        case Negative(operand):
            return unit_of(operand, info)
        case Arithmetic("+" | "-", left, right):
            return unit_of(left, info) or unit_of(right, info)
        case Call(function, operands) if function in _KEEPING:
            return next((unit for unit in (unit_of(o, info) for o in operands) if unit), "")
    return ""


def _conflict(part: Expression, info: ModelInfo) -> Iterator[str]:
    if isinstance(part, Arithmetic) and part.operator in "+-":
        yield from _compared(part.left, part.right, info)
    if isinstance(part, Call) and part.function in ("min", "max"):
        for other in part.operands[1:]:
            yield from _compared(part.operands[0], other, info)


def _compared(left: Expression, right: Expression, info: ModelInfo) -> Iterator[str]:
    one, other = unit_of(left, info), unit_of(right, info)
    if not one or not other or one == other or isinstance(left, Number) or isinstance(right, Number):
        return
    found = conversion(other, one, ({}, {}))
    what = f"{left} is in {one}, {right} in {other}"
    if found is None:
        yield f"{what}; compare or add quantities of the same unit only"
    elif found != (1.0, 0.0):
        factor, offset = found
        shift = f" + {offset:.6g}" if offset else ""
        yield f"{what}; convert one of them: {right} in {one} is {factor:.6g} times it{shift}"
