"""Units in formulas: what is compared or added should have the same one."""

from collections.abc import Iterator

from falsifier.core.model import Model, ModelInfo
from falsifier.fmu import FmuModel
from falsifier.fmu.description import Units, conversion, is_known, read_structure
from falsifier.stl import Formula
from falsifier.stl.expression import Arithmetic, Call, Expression, Name, Negative, Number
from falsifier.stl.formula import Predicate

# Units of plain numbers, which fit any other.
_PLAIN = ("1", "-")
# Functions whose value has the unit of their operands.
_KEEPING = ("abs", "min", "max")


def defined_units(model: Model) -> Units:
    """Return the units that a model defines itself; empty if it is no FMU that can define any."""
    if not isinstance(model, FmuModel) or not model.info.fmi_version.startswith(("2", "3")):
        return {}
    return read_structure(model.path, model.sha256).units


def unit_conflicts(formula: Formula, info: ModelInfo, units: Units) -> Iterator[tuple[Predicate, str]]:
    """Yield each comparison whose units do not fit, and what is wrong with it.

    Numbers fit any unit, and so do units that nobody defines. Products and quotients are not judged: a factor
    may convert units.

    Args:
        formula: the formula.
        info: units of the signals.
        units: what the model says of its units, beside the usual ones.
    """
    for predicate in formula.predicates:
        for part in (*predicate.left.walk(), *predicate.right.walk()):
            yield from ((predicate, text) for text in _conflict(part, info, units))
        yield from ((predicate, text) for text in _compared(predicate.left, predicate.right, info, units))


def unit_of(expression: Expression, info: ModelInfo) -> str:
    """Return the unit of an expression; empty if it is not known."""
    match expression:
        case Name(name):
            unit = info[name].unit if name in info else ""
            return "" if unit in _PLAIN else unit
        case Negative(operand):
            return unit_of(operand, info)
        case Arithmetic("+" | "-", left, right):
            return unit_of(left, info) or unit_of(right, info)
        case Call(function, operands) if function in _KEEPING:
            return next((unit for unit in (unit_of(o, info) for o in operands) if unit), "")
    return ""


def _conflict(part: Expression, info: ModelInfo, units: Units) -> Iterator[str]:
    if isinstance(part, Arithmetic) and part.operator in "+-":
        yield from _compared(part.left, part.right, info, units)
    if isinstance(part, Call) and part.function in ("min", "max"):
        for other in part.operands[1:]:
            yield from _compared(part.operands[0], other, info, units)


def _compared(left: Expression, right: Expression, info: ModelInfo, units: Units) -> Iterator[str]:
    one, other = unit_of(left, info), unit_of(right, info)
    if not one or not other or one == other or isinstance(left, Number) or isinstance(right, Number):
        return
    if not is_known(one, units) or not is_known(other, units):
        return
    found = conversion(other, one, (units, units))
    what = f"{left} is in {one}, {right} in {other}"
    if found is None:
        yield f"{what}; compare or add quantities of the same unit only"
    elif found != (1.0, 0.0):
        factor, offset = found
        shift = f" + {offset:.6g}" if offset else ""
        yield f"{what}; convert one of them: {right} in {one} is {factor:.6g} times it{shift}"
