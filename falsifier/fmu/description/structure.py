"""What an FMU declares of its structure: its units, and which outputs depend on which inputs."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import pi
from pathlib import Path
from xml.etree.ElementTree import Element

from falsifier.errors import ModelFileError
from falsifier.fmu.description.archive import read_entry
from falsifier.fmu.description.variables import about, real, whole
from falsifier.fmu.description.xml import read_xml

_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit in terms of SI base units: a value v of it is ``factor * v + offset`` of these."""

    exponents: tuple[int, ...]  # exponents of kg, m, s, A, K, mol, cd and rad
    factor: float = 1.0  # factor to the SI unit
    offset: float = 0.0  # offset to the SI unit


Units = Mapping[str, Unit]


def read_units(root: Element, *, tag: str = "UnitDefinitions/Unit") -> dict[str, Unit]:
    """Return the units that a description defines by base units (FMI 2 and 3); those without are left out.

    Raises:
        ValueError: naming the unit of which a number is not one, or a name is missing.
    """
    found = {}
    for element in root.findall(tag):
        base = element.find("{*}BaseUnit")
        if base is not None:
            with about(element):
                found[element.attrib["name"]] = Unit(
                    tuple(whole(base.attrib, name, "0") for name in _BASE),
                    real(base.attrib, "factor", "1"),
                    real(base.attrib, "offset", "0"),
                )
    return found


def conversion(
    source: str, target: str, known: tuple[Units, Units], *, is_relative: bool = False
) -> tuple[float, float] | None:
    """Return factor and offset that convert a value to another unit; None for an unknown or an unlike one.

    A unit that is not stated converts to any other unchanged. ``known`` are the units that the FMU of the
    source defines, and that of the target. Offsets do not move differences (``is_relative``).

    >>> conversion("km/h", "m/s", ({}, {}))
    (0.2777777777777778, 0.0)
    >>> conversion("degC", "K", ({}, {})), conversion("degC", "K", ({}, {}), is_relative=True)
    ((1.0, 273.15), (1.0, 0.0))
    """
    if source == target or not source or not target:
        return 1.0, 0.0
    a = _look_up(source, (known[0], known[1], _COMMON))
    b = _look_up(target, (known[1], known[0], _COMMON))
    if a is None or b is None or a.exponents != b.exponents or not b.factor:
        return None
    return a.factor / b.factor, 0.0 if is_relative else (a.offset - b.offset) / b.factor


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


@dataclass(frozen=True, slots=True)
class Structure:
    """Units and dependencies of an FMU. Arrays have the names that the FMU declares.

    FMUs declare what outputs and derivatives of states depend on. What they keep in discrete variables is
    not part of it, so that a declared independence is strong evidence and no proof.
    """

    units: Units  # units that it defines, by name
    # The inputs on which an output depends directly, by its name; one that is missing may depend on all.
    inputs_of: Mapping[str, frozenset[str]]
    # The inputs on which an output can depend, directly or through states; likewise.
    reaching: Mapping[str, frozenset[str]]


@lru_cache(maxsize=32)
def read_structure(path: Path, sha256: str) -> Structure:
    """Return the structure of an FMU of FMI 2 or 3 whose content has this hash; cached.

    Raises:
        ModelError: if its description cannot be read or does not follow the standard.
    """
    root = read_xml(read_entry(path, "modelDescription.xml"), f"{path}: modelDescription.xml", ModelFileError)
    try:
        return Structure(read_units(root), *_dependencies(root))
    except (LookupError, ValueError) as error:
        said = f"there is no {error.args[0]!r}" if isinstance(error, KeyError) else error
        raise ModelFileError(
            f"{path}: units or dependencies in modelDescription.xml do not follow the standard ({said})"
        ) from error


def _dependencies(root: Element) -> tuple[dict[str, frozenset[str]], dict[str, frozenset[str]]]:
    """Return the inputs of each output: the direct ones, and those that reach it."""
    is_3 = root.get("fmiVersion", "").startswith("3")
    variables = root.findall("ModelVariables/*")
    # FMI 2 counts variables from 1, FMI 3 has value references.
    keys = [v.attrib["valueReference"] if is_3 else str(k) for k, v in enumerate(variables, start=1)]
    named = dict(zip(keys, variables, strict=True))
    inputs = {key for key, v in named.items() if v.get("causality") == "input"}
    outputs, derivatives = (
        ("Output", "ContinuousStateDerivative") if is_3 else ("Outputs/Unknown", "Derivatives/Unknown")
    )
    derivative_of = {
        _state_of(named[key]): known for key, known in _stated(root, derivatives, is_3=is_3).items()
    }

    def names(keys: Iterable[str]) -> frozenset[str]:
        return frozenset(named[key].attrib["name"] for key in keys)

    direct, reaching = {}, {}
    for key, known in _stated(root, outputs, is_3=is_3).items():
        name = named[key].attrib["name"]
        if known is not None:
            direct[name] = names(known) & names(inputs)
        reached = _closure(known, derivative_of, inputs)
        if reached is not None:
            reaching[name] = names(reached)
    return direct, reaching


def _stated(root: Element, path: str, *, is_3: bool) -> dict[str, frozenset[str] | None]:
    """Return what each unknown depends on; None if the FMU does not say so."""
    key = "valueReference" if is_3 else "index"
    return {
        e.attrib[key]: None if e.get("dependencies") is None else frozenset(e.attrib["dependencies"].split())
        for e in root.findall(f"ModelStructure/{path}")
    }


def _state_of(derivative: Element) -> str:
    """Return the key of the state of which this variable is the derivative."""
    real = derivative if derivative.get("derivative") is not None else derivative.find("Real")
    return "" if real is None else real.get("derivative", "")


def _closure(
    known: frozenset[str] | None, derivative_of: Mapping[str, frozenset[str] | None], inputs: set[str]
) -> set[str] | None:
    """Return all inputs that are reached through states; None if one of them says nothing."""
    reached: set[str] = set()
    queue = [known]
    while queue:
        step = queue.pop()
        if step is None:
            return None
        new = step - reached
        reached |= new
        queue += [derivative_of.get(key) for key in new - inputs]
    return reached & inputs
