"""Units in formulas: what is compared or added should have the same one."""

from collections.abc import Iterator, Mapping

from falsifier.core.model import Model, ModelInfo
from falsifier.fmu import FmuModel
from falsifier.fmu.description import Units, conversion, is_known, read_structure
from falsifier.stl import Formula
from falsifier.stl.expression import Arithmetic, Call, Expression, Number, unit_of
from falsifier.stl.formula import Predicate

# Units of signals by name.
Known = Mapping[str, str]


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
    known = {name: info[name].unit for name in formula.signals if name in info}
    for predicate in formula.predicates:
        for part in (*predicate.left.walk(), *predicate.right.walk()):
            yield from ((predicate, text) for text in _conflict(part, known, units))
        yield from ((predicate, text) for text in _compared(predicate.left, predicate.right, known, units))


def _conflict(part: Expression, known: Known, units: Units) -> Iterator[str]:
    if isinstance(part, Arithmetic) and part.operator in "+-":
        yield from _compared(part.left, part.right, known, units)
    if isinstance(part, Call) and part.function in ("min", "max"):
        for other in part.operands[1:]:
            yield from _compared(part.operands[0], other, known, units)


def _compared(left: Expression, right: Expression, known: Known, units: Units) -> Iterator[str]:
    one, other = unit_of(left, known), unit_of(right, known)
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
