"""What an FMU declares of its structure: its units, and which outputs depend on which inputs."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element

from falsifier.errors import ModelError
from falsifier.fmu.description.archive import read_entry
from falsifier.fmu.description.units import Units, read_units
from falsifier.fmu.description.xml import read_xml


@dataclass(frozen=True, slots=True)
class Structure:
    """Units and dependencies of an FMU. Arrays have the names that the FMU declares.

    FMUs declare what outputs and derivatives of states depend on. What they keep in discrete variables is
    not part of it, so that a declared independence is strong evidence and no proof.

    Attributes:
        units: units that it defines, by name.
        inputs_of: the inputs on which an output depends directly, by the output's name; an output that is
            missing here may depend on all inputs.
        reaching: the inputs on which an output can depend, directly or through states; likewise.
    """

    units: Units
    inputs_of: Mapping[str, frozenset[str]]
    reaching: Mapping[str, frozenset[str]]


@lru_cache(maxsize=32)
def read_structure(path: Path, sha256: str) -> Structure:
    """Return the structure of an FMU of FMI 2 or 3 whose content has this hash; cached.

    Raises:
        ModelError: if its description cannot be read or does not follow the standard.
    """
    root = read_xml(read_entry(path, "modelDescription.xml"), f"{path}: modelDescription.xml", ModelError)
    try:
        return Structure(read_units(root), *_dependencies(root))
    except (LookupError, ValueError) as error:
        raise ModelError(
            f"{path}: units or dependencies in modelDescription.xml do not follow the standard "
            f"({type(error).__name__}: {error})"
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
