"""modelDescription.xml, the description of an FMU, as frozen values.

Element and attribute names are those of the FMI standards 1.0.1, 2.0.5 and 3.0.2.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import product
from math import isfinite, prod
from pathlib import Path, PurePosixPath
from typing import cast
from xml.etree.ElementTree import Element

from falsifier.core.model import Causality, Interface, Kind, ModelInfo, Variable
from falsifier.errors import ModelError, did_you_mean
from falsifier.fmu.description import archive
from falsifier.fmu.description.libraries import find_libraries
from falsifier.fmu.description.remarks import input_clocks, remarks, with_aliases_marked
from falsifier.fmu.description.slot import Slot
from falsifier.fmu.description.wine import can_run_windows, windows_text
from falsifier.fmu.description.xml import read_xml

# Element name -> (kind, type code). The type code names the FMU's get and set functions for the value.
_TYPES_1_2: Mapping[str, tuple[Kind, str]] = {
    "Real": ("real", "Real"),
    "Integer": ("integer", "Integer"),
    "Boolean": ("boolean", "Boolean"),
    "Enumeration": ("enumeration", "Integer"),
    "String": ("string", "String"),
}
_TYPES_3: Mapping[str, tuple[Kind, str]] = {
    "Float64": ("real", "Float64"),
    "Float32": ("real", "Float32"),
    **{f"{sign}Int{bits}": ("integer", f"{sign}Int{bits}") for sign in ("", "U") for bits in (8, 16, 32, 64)},
    "Boolean": ("boolean", "Boolean"),
    "Enumeration": ("enumeration", "Int64"),
    "String": ("string", "String"),
}
# Simulink writes the largest double for an open limit, Dymola 1e30 or more, OpenModelica 1e60, others INF.
_NO_LIMIT = 1e30
_INTERFACE_TAGS: Mapping[str, Interface] = {
    "CoSimulation": "co-simulation",
    "ModelExchange": "model-exchange",
}
# Limits of what descriptions may contain; real ones stay far below.
_MAX_ELEMENTS = 1_000_000
_LONGEST_NAME = 10_000
_LARGEST_REFERENCE = 2**32 - 1
_CAUSALITIES: Mapping[str, Causality] = {
    "input": "input",
    "output": "output",
    "parameter": "parameter",
    "structuralParameter": "parameter",
    "calculatedParameter": "calculatedParameter",
    "independent": "independent",
}


@dataclass(frozen=True, slots=True)
class Description:
    """Contents of a modelDescription.xml.

    Attributes:
        info: what other packages need.
        token: GUID (FMI 1 and 2) or instantiation token (FMI 3).
        identifiers: model identifier by interface.
        libraries: path of this platform's library inside the archive, by interface; missing if there is none.
        windows_libraries: the same for 64-bit Windows.
        slots: how to access each scalar variable, by name.
        arrays: start values of all elements by value reference, for arrays only.
        states: number of continuous states (FMI 1 and 2; FMI 3 reports it at run time).
        indicators: number of event indicators (FMI 1 and 2).
        event_mode: whether the co-simulation interface supports event mode (FMI 3).
        needs_tool: names of interfaces that need the exporting tool to be installed.
        saves_state: names of interfaces whose state can be saved and restored.
    """

    info: ModelInfo
    token: str
    identifiers: Mapping[Interface, str]
    slots: Mapping[str, Slot]
    libraries: Mapping[Interface, PurePosixPath] = field(default_factory=dict)
    windows_libraries: Mapping[Interface, PurePosixPath] = field(default_factory=dict)
    arrays: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    states: int = 0
    indicators: int = 0
    event_mode: bool = False
    needs_tool: tuple[Interface, ...] = ()
    saves_state: tuple[Interface, ...] = ()

    @property
    def major(self) -> int:
        """Major FMI version: 1, 2 or 3."""
        return int(self.info.fmi_version[0])

    def needs_wine(self, interface: Interface) -> bool:
        """Whether the only library that this machine can run is the one for Windows."""
        return can_run_windows() and interface not in self.libraries and interface in self.windows_libraries

    def slot(self, name: str) -> Slot:
        """Return how to access a numeric variable.

        Raises:
            ModelError: if the name is unknown (with the most similar one) or the variable is a string.
        """
        if name not in self.slots:
            raise ModelError(f"{self.info.name}: no variable {name!r}; {did_you_mean(name, self.slots)}")
        if self.slots[name].type == "String":
            raise ModelError(f"{self.info.name}: {name!r} is a string; use a numeric variable")
        return self.slots[name]


def read_info(path: str | Path) -> ModelInfo:
    """Read the description of an FMU without loading its library.

    Raises:
        ModelError: if the file is not an FMU, or not one of FMI 1, 2 or 3.
    """
    return read_description(path).info


def read_description(path: str | Path) -> Description:
    """Return the description of an FMU; a file is read again only if its content has changed.

    Raises:
        ModelError: if the file is not an FMU, or not one of FMI 1, 2 or 3.
    """
    path = Path(path)
    return describe(path, archive.file_hash(path))


@lru_cache(maxsize=32)
def describe(path: Path, sha256: str) -> Description:
    """Return the description of an FMU whose content has this hash; cached.

    Raises:
        ModelError: if the file is not an FMU, or not one of FMI 1, 2 or 3.
    """
    text = archive.read_entry(path, "modelDescription.xml")
    root = read_xml(text, f"{path}: modelDescription.xml", ModelError)
    names = archive.entry_names(path)
    described = parse(root, name=str(path), platforms=archive.platforms(names))
    info = described.info
    libraries, said = find_libraries(names, info.fmi_version, described.identifiers)
    windows, windows_said = find_libraries(names, info.fmi_version, described.identifiers, archive.WINDOWS)
    described = replace(described, libraries=libraries, windows_libraries=windows)
    if any(described.needs_wine(interface) for interface in info.interfaces):
        said = (*said, *windows_said, windows_text())
    return replace(described, info=replace(info, notes=(*info.notes, *said)))


def parse(root: Element, *, name: str, platforms: tuple[str, ...] = ()) -> Description:
    """Return the description in a parsed modelDescription.xml.

    Args:
        root: the ``fmiModelDescription`` element.
        name: file name for error messages.
        platforms: platforms for which the archive contains binaries.

    Raises:
        ModelError: if the FMI version is not 1, 2 or 3, or an attribute is missing or invalid.
    """
    version = root.get("fmiVersion", "")
    if version[:1] not in ("1", "2", "3"):
        raise ModelError(f"{name}: fmiVersion is {version!r}; export it as FMI 1.0, 2.0 or 3.0")
    for element in root.iter():
        text = element.get("description", "")
        if len(text) > _LONGEST_NAME:
            element.set("description", f"{text[:_LONGEST_NAME]} ...")
    try:
        return _parse(root, version, platforms)
    except (KeyError, ValueError, IndexError) as error:
        raise ModelError(
            f"{name}: modelDescription.xml does not follow FMI {version} ({type(error).__name__}: {error})"
        ) from error


def _parse(root: Element, version: str, platforms: tuple[str, ...]) -> Description:
    major = int(version[0])
    identifiers, needs_tool = _interfaces(root, major)
    for name in (root.attrib["modelName"], *identifiers.values(), root.get("generationTool", "")):
        _check_length(name)
    arrays: dict[int, tuple[float, ...]] = {}
    variables: list[Variable] = []
    slots: dict[str, Slot] = {}
    for variable, slot in _variables_3(root, arrays) if major == 3 else _variables_1_2(root, major):
        _check_variable(variable, slot, slots)
        variables.append(variable)
        slots[variable.name] = slot
    marked, slots = with_aliases_marked(variables, slots)
    experiment = _child(root, "DefaultExperiment")
    co_simulation = root.find("CoSimulation")
    start_time, tool = _number(experiment.get("startTime")), root.get("generationTool", "")
    info = ModelInfo(
        name=root.attrib["modelName"],
        description=root.get("description", ""),
        fmi_version=version,
        interfaces=tuple(identifiers),
        platforms=platforms,
        tool=tool,
        start_time=start_time,
        stop_time=_positive(experiment.get("stopTime")),
        step_size=_positive(experiment.get("stepSize")),
        tolerance=_positive(experiment.get("tolerance")),
        variables=marked,
        notes=remarks(root, marked, start_time=start_time, tool=tool, needs_tool=needs_tool),
    )
    return Description(
        info=info,
        token=root.get("instantiationToken" if major == 3 else "guid", ""),
        identifiers=identifiers,
        slots=slots,
        arrays=arrays,
        states=_number_of_states(root, major),
        indicators=int(root.get("numberOfEventIndicators", "0")),
        event_mode=co_simulation is not None and _flag(co_simulation.get("hasEventMode")),
        needs_tool=needs_tool,
        saves_state=_saving(root),
    )


def _check_length(name: str) -> None:
    if len(name) > _LONGEST_NAME:
        raise ValueError(f"the name {name[:40]!r}... has more than {_LONGEST_NAME} characters")


def _check_variable(variable: Variable, slot: Slot, known: Mapping[str, Slot]) -> None:
    _check_length(variable.name)
    if variable.name in known:
        raise ValueError(f"two variables are named {variable.name!r}")
    if not 0 <= slot.reference <= _LARGEST_REFERENCE:
        raise ValueError(f"value reference {slot.reference} of {variable.name!r} does not fit 32 bits")


def _number_of_states(root: Element, major: int) -> int:
    if major == 1:
        return int(root.get("numberOfContinuousStates", "0"))
    return len(root.findall("ModelStructure/Derivatives/Unknown"))


def _interfaces(root: Element, major: int) -> tuple[dict[Interface, str], tuple[Interface, ...]]:
    if major == 1:
        implementation = root.find("Implementation")
        interface: Interface = "model-exchange" if implementation is None else "co-simulation"
        tool = implementation is not None and implementation.find("CoSimulation_Tool") is not None
        return {interface: root.attrib["modelIdentifier"]}, (interface,) if tool else ()
    found: dict[Interface, str] = {}
    needs_tool: list[Interface] = []
    for tag, interface in _INTERFACE_TAGS.items():
        element = root.find(tag)
        if element is not None:
            found[interface] = element.attrib["modelIdentifier"]
            if _flag(element.get("needsExecutionTool")):
                needs_tool.append(interface)
    return found, tuple(needs_tool)


def _saving(root: Element) -> tuple[Interface, ...]:
    attributes = ("canGetAndSetFMUstate", "canGetAndSetFMUState")
    return tuple(
        interface
        for tag, interface in _INTERFACE_TAGS.items()
        if (element := root.find(tag)) is not None and any(_flag(element.get(name)) for name in attributes)
    )


def _variables_1_2(root: Element, major: int) -> Iterator[tuple[Variable, Slot]]:
    types = {t.attrib["name"]: t for t in root.findall("TypeDefinitions/*") if "name" in t.attrib}
    elements = root.findall("ModelVariables/ScalarVariable")
    states = _states_2(root, elements)
    for position, element in enumerate(elements, start=1):
        typed = next((child for child in element if child.tag in _TYPES_1_2), None)
        if typed is None:
            raise ValueError(f"variable {element.attrib['name']!r} has no type")
        kind, code = _TYPES_1_2[typed.tag]
        declared = types.get(typed.get("declaredType", ""))
        definition = None if declared is None else next(iter(declared), None)
        attributes = {**({} if definition is None else definition.attrib), **typed.attrib}
        causality, variability, refusal = _role(element, major, has_start=typed.get("start") is not None)
        yield (
            Variable(
                name=element.attrib["name"],
                kind=kind,
                causality=causality,
                variability=variability,
                unit=_unit(attributes.get("unit")),
                display_unit=_unit(attributes.get("displayUnit")),
                low=_limit(attributes.get("min")),
                high=_limit(attributes.get("max")),
                nominal=_number(attributes.get("nominal")),
                start=_start(kind, typed.get("start")),
                settable=not refusal,
                is_state=position in states,
                literals=_literals(definition),
                description=element.get("description", ""),
                type=code,
            ),
            Slot(
                reference=int(element.attrib["valueReference"]),
                type=code,
                negated=element.get("alias") == "negatedAlias",
                refusal=refusal,
            ),
        )


def _states_2(root: Element, elements: list[Element]) -> set[int]:
    """Return the positions, counted from 1, of the continuous states; FMI 1 does not list them."""
    states = set()
    for unknown in root.findall("ModelStructure/Derivatives/Unknown"):
        derivative = elements[int(unknown.attrib["index"]) - 1].find("Real")
        if derivative is not None and derivative.get("derivative"):
            states.add(int(derivative.attrib["derivative"]))
    return states


def _variables_3(root: Element, arrays: dict[int, tuple[float, ...]]) -> Iterator[tuple[Variable, Slot]]:
    types = {t.attrib["name"]: t for t in root.findall("TypeDefinitions/*")}
    elements = {int(e.attrib["valueReference"]): e for e in root.findall("ModelVariables/*")}
    states = {
        int(elements[int(d.attrib["valueReference"])].attrib["derivative"])
        for d in root.findall("ModelStructure/ContinuousStateDerivative")
    }
    ticked = set(input_clocks(root))
    for reference, element in elements.items():
        if element.tag not in _TYPES_3:
            continue
        kind, code = _TYPES_3[element.tag]
        definition = types.get(element.get("declaredType", ""))
        attributes = {**({} if definition is None else definition.attrib), **element.attrib}
        starts = _starts_3(kind, element)
        default = "continuous" if kind == "real" else "discrete"
        causality, variability, refusal = _role(element, 3, default, has_start=bool(starts))
        clocks = set(map(int, element.get("clocks", "").split()))
        if clocks:
            refusal = "it belongs to a clock; only the FMU itself may change it"
        shape = tuple(_extent(d, elements) for d in element.findall("Dimension"))
        count = prod(shape)
        if not 0 <= count <= _MAX_ELEMENTS:
            raise ValueError(f"array {element.get('name')!r} has {count} elements, not 0 to {_MAX_ELEMENTS}")
        starts = starts * count if len(starts) == 1 else starts
        if shape and kind != "string":
            arrays[reference] = tuple(float(s or 0.0) for s in starts) if starts else (0.0,) * count
        variable = Variable(
            name=element.attrib["name"],
            kind=kind,
            causality=causality,
            variability=variability,
            unit=_unit(attributes.get("unit")),
            display_unit=_unit(attributes.get("displayUnit")),
            low=_limit(attributes.get("min")),
            high=_limit(attributes.get("max")),
            nominal=_number(attributes.get("nominal")),
            settable=not refusal,
            is_state=reference in states,
            literals=_literals(definition),
            description=element.get("description", ""),
            type=code,
            is_clocked=bool(clocks) and (clocks <= ticked or causality == "input"),
        )
        names = [(variable.name, variable.description)]
        names += [(a.attrib["name"], a.get("description", "")) for a in element.findall("Alias")]
        for name, description in names:
            for offset, index in enumerate(product(*(range(1, n + 1) for n in shape))):
                suffix = f"[{','.join(map(str, index))}]" if shape else ""
                yield (
                    replace(
                        variable,
                        name=name + suffix,
                        description=description,
                        start=starts[offset] if starts else None,
                    ),
                    Slot(reference, code, offset, count, refusal=refusal, declared=variable.name),
                )


def _role(
    element: Element, major: int, default_variability: str = "continuous", *, has_start: bool
) -> tuple[Causality, str, str]:
    """Return causality, variability and why the variable cannot be set (empty if it can)."""
    causality = element.get("causality", "local")
    variability = element.get("variability", default_variability)
    if major == 1:
        if variability == "parameter":
            causality, variability = "parameter", "fixed"
        refusal = "" if has_start or causality == "input" else "it has no start value; the model computes it"
    elif causality in ("parameter", "input"):
        if causality == "parameter":
            variability = element.get("variability", "fixed")
        refusal = ""
    elif causality == "structuralParameter":
        refusal = "it is a structural parameter, which sets array sizes"
    elif causality == "calculatedParameter":
        refusal = "it is a calculated parameter; set the parameters from which the model calculates it"
    elif causality == "independent":
        refusal = "it is the independent variable, time"
    else:
        initial = element.get("initial", "exact" if has_start else "calculated")
        refusal = "" if initial in ("exact", "approx") else "the model computes its initial value"
    if variability == "constant":
        refusal = "it is a constant"
    return _CAUSALITIES.get(causality, "local"), variability, refusal


def _extent(dimension: Element, elements: Mapping[int, Element]) -> int:
    if "start" in dimension.attrib:
        return int(dimension.attrib["start"])
    return int(elements[int(dimension.attrib["valueReference"])].attrib["start"])


def _starts_3(kind: Kind, element: Element) -> tuple[float | str | None, ...]:
    if kind == "string":
        return tuple(s.get("value", "") for s in element.findall("Start"))
    return tuple(_start(kind, word) for word in element.get("start", "").split())


def _start(kind: Kind, text: str | None) -> float | str | None:
    if text is None or kind == "string":
        return text
    return float(_flag(text)) if kind == "boolean" else float(text)


def _literals(definition: Element | None) -> dict[str, int]:
    if definition is None:
        return {}
    items = definition.findall("Item")
    return {item.attrib["name"]: int(item.get("value", k)) for k, item in enumerate(items, start=1)}


def _child(root: Element, tag: str) -> Mapping[str, str]:
    element = root.find(tag)
    return {} if element is None else cast(Mapping[str, str], element.attrib)


def _number(text: str | None) -> float | None:
    number = None if text is None else float(text)
    return number if number is not None and isfinite(number) else None  # NaN and infinity limit nothing


def _positive(text: str | None) -> float | None:
    """Return a time or tolerance of the default experiment; None if no simulation could use it."""
    number = _number(text)
    return number if number is not None and number > 0.0 else None


def _limit(text: str | None) -> float | None:
    """Return a min or max; None for the huge numbers with which tools write that there is none."""
    number = _number(text)
    return None if number is None or not abs(number) < _NO_LIMIT else number


def _flag(text: str | None) -> bool:
    return text is not None and text.strip() in ("true", "1")


def _unit(text: str | None) -> str:
    """Return a unit; empty for 1, which FMUs use for dimensionless variables."""
    return "" if text in (None, "1") else str(text)
