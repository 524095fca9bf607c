"""Units in formulas: what is compared or added should have the same one; and units as people write them."""

from collections.abc import Iterator, Mapping

from falsifier.core.model import Model, ModelInfo
from falsifier.fmu import FmuModel, System
from falsifier.fmu.description.structure import Units, conversion, is_known, read_structure
from falsifier.stl import Formula
from falsifier.stl.expression import Arithmetic, Call, Expression, Number, unit_of
from falsifier.stl.formula import Predicate

# What people write, in lower case, by the name that conversions know. Of a shaft, 1/min is a speed.
_SPELLINGS = {
    spelling: name
    for name, spellings in {
        "%": "percent, per cent, pct",
        "rpm": "1/min, min-1, min^-1, u/min, upm, r/min, rev/min, rev per minute, revolutions per minute",
        "mph": "mi/h, mile/h, miles/h, miles per hour",
        "km/h": "kph, kmh, kmph, km per hour, kilometers per hour, kilometres per hour",
        "m/s": "mps, m per second, meters per second, metres per second",
        "m/s2": "m/s^2, m/s², m/s/s",
        "m": "meter, meters, metre, metres",
        "ft": "foot, feet",
        "s": "sec, second, seconds",
        "ms": "msec, millisecond, milliseconds",
        "min": "mins, minute, minutes",
        "h": "hour, hours",
        "deg": "°, degree, degrees",
        "degC": "°c, deg c, celsius, degrees celsius",
        "degF": "°f, deg f, fahrenheit, degrees fahrenheit",
        "K": "kelvin",
        "rad": "radian, radians",
        "V": "volt, volts",
        "A": "amp, amps, ampere, amperes",
        "W": "watt, watts",
        "Pa": "pascal",
        "N.m": "nm, n m, n*m",
    }.items()
    for spelling in spellings.split(", ")
}


def defined_units(model: Model) -> Units:
    """Return the units that a model defines itself, a system those of its FMUs; empty if it cannot."""
    if isinstance(model, System):
        tables = [read_structure(each.fmu, each.sha256).units for each in model.parts.values()]
        agreed = (n for table in tables for n in table if all(t.get(n, table[n]) == table[n] for t in tables))
        return {name: next(table[name] for table in tables if name in table) for name in agreed}
    if not isinstance(model, FmuModel) or not model.info.fmi_version.startswith(("2", "3")):
        return {}
    return read_structure(model.path, model.sha256).units


def spelled(unit: str) -> str:
    """Return a unit by the name that conversions know; as it is if that is unknown.

    >>> spelled("MPH"), spelled("U/min"), spelled("per cent"), spelled("mA")
    ('mph', 'rpm', '%', 'mA')
    """
    unit = " ".join(unit.split())
    if is_known(unit, {}):
        return unit
    lowered = unit.lower()
    # Of one or two letters the case counts: T is no t.
    return _SPELLINGS.get(lowered, lowered if len(unit) > 2 and is_known(lowered, {}) else unit)


def factor_and_offset(
    source: str, target: str, units: Units, *, is_relative: bool = False
) -> tuple[float, float] | None:
    """Return what converts a value or a difference from one unit to another, whichever way they are written.

    None if they are of different kinds, or nobody says what they are.

    >>> factor_and_offset("1/min", "rev/min", {}), factor_and_offset("m", "mph", {})
    ((1.0, 0.0), None)
    """
    if spelled(source) == spelled(target):
        return 1.0, 0.0
    a, b = (unit if is_known(unit, units) else spelled(unit) for unit in (source, target))
    found = conversion(a, b, (units, units), is_relative=is_relative) if a and b else None
    # Without the digits of rounding, so that equal units have the factor 1.
    return None if found is None else (float(f"{found[0]:.12g}"), float(f"{found[1]:.12g}"))


def unit_conflicts(formula: Formula, info: ModelInfo, units: Units) -> Iterator[tuple[Predicate, str]]:
    """Yield each comparison whose units do not fit, and what is wrong with it.

    Numbers fit any unit, and so do units that nobody defines. Products and quotients are not judged: a factor
    may convert units. ``units`` are those that the model defines, beside the usual ones.
    """
    known = {name: info[name].unit for name in formula.signals if name in info}
    for predicate in formula.predicates:
        pairs = [(predicate.left, predicate.right)]
        for part in (*predicate.left.walk(), *predicate.right.walk()):
            match part:
                case Arithmetic("+" | "-") | Call("min" | "max"):
                    pairs += [(part.operands[0], other) for other in part.operands[1:]]
        for one, other in pairs:
            yield from ((predicate, text) for text in _compared(one, other, known, units))


def _compared(left: Expression, right: Expression, known: Mapping[str, str], units: Units) -> Iterator[str]:
    one, other = unit_of(left, known), unit_of(right, known)
    if not one or not other or one == other or isinstance(left, Number) or isinstance(right, Number):
        return
    if not all(is_known(unit, units) or is_known(spelled(unit), units) for unit in (one, other)):
        return
    found = factor_and_offset(other, one, units)
    what = f"{left} is in {one}, {right} in {other}"
    if found is None:
        yield f"{what}; compare or add quantities of the same unit only"
    elif found != (1.0, 0.0):
        factor, offset = found
        shift = f" {'-' if offset < 0 else '+'} {abs(offset):.6g}" if offset else ""
        yield f"{what}; convert one of them: {right} in {one} is {factor:.6g} times it{shift}"
