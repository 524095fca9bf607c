"""What only systems need of an FMU's description: its units, and which outputs depend on which inputs."""

from collections.abc import Iterator, Mapping
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
    """Units and dependencies of an FMU.

    Attributes:
        units: units that it defines, by name.
        inputs_of: the inputs on which an output depends directly, by the output's name; an output that is
            missing here may depend on all inputs. Arrays have the names that the FMU declares.
    """

    units: Units
    inputs_of: Mapping[str, frozenset[str]]


@lru_cache(maxsize=32)
def read_structure(path: Path, sha256: str) -> Structure:
    """Return the structure of an FMU of FMI 2 or 3 whose content has this hash; cached.

    Raises:
        ModelError: if its description cannot be read or does not follow the standard.
    """
    root = read_xml(read_entry(path, "modelDescription.xml"), f"{path}: modelDescription.xml", ModelError)
    try:
        return Structure(read_units(root), dict(_dependencies(root)))
    except (LookupError, ValueError) as error:
        raise ModelError(
            f"{path}: units or dependencies in modelDescription.xml do not follow the standard "
            f"({type(error).__name__}: {error})"
        ) from error


def _dependencies(root: Element) -> Iterator[tuple[str, frozenset[str]]]:
    is_3 = root.get("fmiVersion", "").startswith("3")
    variables = root.findall("ModelVariables/*")
    # FMI 2 counts variables from 1, FMI 3 has value references.
    keys = [v.attrib["valueReference"] if is_3 else str(k) for k, v in enumerate(variables, start=1)]
    names = {key: v.attrib["name"] for key, v in zip(keys, variables, strict=True)}
    inputs = {n for n, v in zip(names.values(), variables, strict=True) if v.get("causality") == "input"}
    path, key = ("Output", "valueReference") if is_3 else ("Outputs/Unknown", "index")
    for output in root.findall(f"ModelStructure/{path}"):
        stated = output.get("dependencies")
        if stated is not None:
            yield names[output.attrib[key]], frozenset(names[k] for k in stated.split()) & inputs
