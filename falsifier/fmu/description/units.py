"""Units of connected variables: conversion by what the FMUs define, otherwise by name."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi
from xml.etree.ElementTree import Element

_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit in terms of SI base units: a value v of it is ``factor * v + offset`` of these.

    Attributes:
        exponents: exponents of kg, m, s, A, K, mol, cd and rad.
        factor: factor to the SI unit.
        offset: offset to the SI unit.
    """

    exponents: tuple[int, ...]
    factor: float = 1.0
    offset: float = 0.0


Units = Mapping[str, Unit]


def read_units(root: Element, *, tag: str = "UnitDefinitions/Unit") -> dict[str, Unit]:
    """Return the units that a description defines by base units (FMI 2 and 3); those without are left out.

    Raises:
        ValueError: if a number is not one.
    """
    found = {}
    for element in root.findall(tag):
        base = element.find("{*}BaseUnit")
        if base is not None:
            found[element.attrib["name"]] = Unit(
                tuple(int(base.get(name, "0")) for name in _BASE),
                float(base.get("factor", "1")),
                float(base.get("offset", "0")),
            )
    return found


def conversion(source: str, target: str, known: tuple[Units, Units]) -> tuple[float, float] | None:
    """Return factor and offset that convert a value from one unit to another; None if nobody defines them.

    A unit that is not stated converts to any other unchanged.

    Args:
        source: unit of the value.
        target: unit that is wanted.
        known: units defined by the FMU of the source, and by that of the target.

    >>> conversion("km/h", "m/s", ({}, {}))
    (0.2777777777777778, 0.0)
    """
    if source == target or not source or not target:
        return 1.0, 0.0
    a = _look_up(source, (known[0], known[1], _COMMON))
    b = _look_up(target, (known[1], known[0], _COMMON))
    if a is None or b is None or a.exponents != b.exponents or not b.factor:
        return None
    return a.factor / b.factor, (a.offset - b.offset) / b.factor


def is_known(name: str, units: Units) -> bool:
    """Whether somebody says what a unit is: these definitions, or the usual ones."""
    return _look_up(name, (units, _COMMON)) is not None


def _look_up(name: str, tables: Sequence[Units]) -> Unit | None:
    return next((table[name] for table in tables if name in table), None)


def _unit(factor: float = 1.0, offset: float = 0.0, **exponents: int) -> Unit:
    return Unit(tuple(exponents.get(name, 0) for name in _BASE), factor, offset)


# For FMUs that name units and do not define them.
_COMMON: Units = {
    "m": _unit(m=1),
    "mm": _unit(1e-3, m=1),
    "cm": _unit(1e-2, m=1),
    "km": _unit(1e3, m=1),
    "ft": _unit(0.3048, m=1),
    "s": _unit(s=1),
    "ms": _unit(1e-3, s=1),
    "min": _unit(60.0, s=1),
    "h": _unit(3600.0, s=1),
    "kg": _unit(kg=1),
    "g": _unit(1e-3, kg=1),
    "t": _unit(1e3, kg=1),
    "m/s": _unit(m=1, s=-1),
    "km/h": _unit(1.0 / 3.6, m=1, s=-1),
    "mph": _unit(0.44704, m=1, s=-1),
    "m/s2": _unit(m=1, s=-2),
    "rad": _unit(rad=1),
    "deg": _unit(pi / 180.0, rad=1),
    "rad/s": _unit(rad=1, s=-1),
    "deg/s": _unit(pi / 180.0, rad=1, s=-1),
    "rpm": _unit(pi / 30.0, rad=1, s=-1),
    "rev/min": _unit(pi / 30.0, rad=1, s=-1),
    "K": _unit(K=1),
    "degC": _unit(1.0, 273.15, K=1),
    "degF": _unit(5.0 / 9.0, 459.67 * 5.0 / 9.0, K=1),
    "N": _unit(kg=1, m=1, s=-2),
    "kN": _unit(1e3, kg=1, m=1, s=-2),
    "N.m": _unit(kg=1, m=2, s=-2),
    "J": _unit(kg=1, m=2, s=-2),
    "kJ": _unit(1e3, kg=1, m=2, s=-2),
    "W": _unit(kg=1, m=2, s=-3),
    "kW": _unit(1e3, kg=1, m=2, s=-3),
    "Pa": _unit(kg=1, m=-1, s=-2),
    "kPa": _unit(1e3, kg=1, m=-1, s=-2),
    "bar": _unit(1e5, kg=1, m=-1, s=-2),
    "A": _unit(A=1),
    "mA": _unit(1e-3, A=1),
    "V": _unit(kg=1, m=2, s=-3, A=-1),
    "mV": _unit(1e-3, kg=1, m=2, s=-3, A=-1),
    "kV": _unit(1e3, kg=1, m=2, s=-3, A=-1),
    "%": _unit(1e-2),
}
