"""Which outputs of an FMU can depend on which inputs, directly or through its states, as it declares."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element

from falsifier.errors import ModelError
from falsifier.fmu.description.archive import read_entry
from falsifier.fmu.description.xml import read_xml


@lru_cache(maxsize=32)
def inputs_of_outputs(path: Path, sha256: str) -> Mapping[str, frozenset[str]]:
    """Return the inputs on which each output can depend; an output that is missing may depend on all.

    FMUs declare what outputs and derivatives of states depend on. What they keep in discrete variables is
    not part of it, so that a declared independence is strong evidence and no proof.

    Raises:
        ModelError: if its description cannot be read or does not follow the standard.
    """
    root = read_xml(read_entry(path, "modelDescription.xml"), f"{path}: modelDescription.xml", ModelError)
    try:
        return _reachable(root)
    except (LookupError, ValueError) as error:
        raise ModelError(
            f"{path}: dependencies in modelDescription.xml do not follow the standard "
            f"({type(error).__name__}: {error})"
        ) from error


def _reachable(root: Element) -> dict[str, frozenset[str]]:
    is_3 = root.get("fmiVersion", "").startswith("3")
    variables = root.findall("ModelVariables/*")
    # FMI 2 counts variables from 1, FMI 3 has value references.
    keys = [v.attrib["valueReference"] if is_3 else str(k) for k, v in enumerate(variables, start=1)]
    named = dict(zip(keys, variables, strict=True))
    inputs = {key for key, v in named.items() if v.get("causality") == "input"}
    outputs, derivatives = (
        ("Output", "ContinuousStateDerivative") if is_3 else ("Outputs/Unknown", "Derivatives/Unknown")
    )
    stated = _stated(root, outputs, is_3=is_3)
    derivative_of = {
        _state_of(named[key]): known for key, known in _stated(root, derivatives, is_3=is_3).items()
    }
    found = {}
    for key, known in stated.items():
        reached = _closure(known, derivative_of, inputs)
        if reached is not None:
            found[named[key].attrib["name"]] = frozenset(named[k].attrib["name"] for k in reached)
    return found


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
