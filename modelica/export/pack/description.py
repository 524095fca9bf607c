"""modelDescription.xml for FMI 2.0 and 3.0."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from ..flat.ir import Lit, Type, Variable
from ..order.layout import System, kinds_of
from .units import base_unit, display_unit

GUID_MARK = "{GUID}"


TOOL = "falsifier Modelica exporter"


@dataclass(frozen=True, slots=True)
class Entry:
    """A variable in modelDescription.xml."""

    name: str
    reference: int
    type: Type
    causality: str
    variability: str
    initial: str | None
    start: str | None
    variable: Variable | None
    derivative_of: str | None = None


def model_identifier(system: System) -> str:
    """Return the C identifier of the model, which is also the file name of the FMU's binaries."""
    return system.model.name.rsplit(".", 1)[-1]


def entries(system: System) -> list[Entry]:
    """Return all variables of the FMU: inputs, outputs, parameters, other public variables, states."""
    references = {name: k for k, name in enumerate([*system.reals, *system.ints])}
    kinds = kinds_of(system)
    states, shown = set(system.states), []
    for name, variable in system.model.variables.items():
        if name.startswith("$") or not (variable.public or name in states):
            continue
        shown.append(_entry(system, variable, references[name], kinds.get(name, "KIND_LOCAL")))
    rank = {"input": 0, "output": 1, "parameter": 2, "calculatedParameter": 3, "local": 4}
    shown.sort(key=lambda entry: rank[entry.causality])
    for name in system.states:
        der = f"der({name})"
        shown.append(
            Entry(der, references[der], "Real", "local", "continuous", "calculated", None, None, name)
        )
    return shown


def _entry(system: System, variable: Variable, reference: int, kind: str) -> Entry:
    known = variable.binding if variable.variability == "parameter" else variable.start
    literal = _value(known.value if isinstance(known, Lit) else 0, variable.type)
    if variable.variability == "parameter":
        if not isinstance(variable.binding, Lit):
            return _make(variable, reference, "calculatedParameter", "tunable", "calculated", None)
        if kind == "KIND_LOCAL":
            return _make(variable, reference, "local", "constant", "exact", literal)
        variability = "fixed" if kind == "KIND_FIXED" else "tunable"
        return _make(variable, reference, "parameter", variability, "exact", literal)
    name = variable.name
    continuous = variable.type == "Real" and name not in system.discrete_reals
    variability = "continuous" if continuous else "discrete"
    if variable.causality == "input":
        return _make(variable, reference, "input", variability, None, literal)
    if kind == "KIND_START":
        return _make(variable, reference, variable.causality, variability, "exact", literal)
    return _make(variable, reference, variable.causality, variability, "calculated", None)


def _make(
    variable: Variable,
    reference: int,
    causality: str,
    variability: str,
    initial: str | None,
    start: str | None,
) -> Entry:
    return Entry(variable.name, reference, variable.type, causality, variability, initial, start, variable)


def _value(value: float, kind: str) -> str:
    if kind == "Boolean":
        return "true" if value else "false"
    return repr(float(value)) if kind == "Real" else str(int(value))


def _typed(variable: Variable | None, kind: str) -> dict[str, str]:
    """Return the attributes that both FMI versions have in common."""
    if variable is None:
        return {}
    found = {"quantity": variable.quantity} if variable.quantity else {}
    if kind == "Real":
        if variable.unit:
            found["unit"] = variable.unit
        other = variable.display_unit != variable.unit
        if variable.display_unit and other and display_unit(variable.display_unit, variable.unit):
            found["displayUnit"] = variable.display_unit
    if kind != "Boolean":
        for key, value in (("min", variable.minimum), ("max", variable.maximum)):
            if value is not None:
                found[key] = _value(value, kind)
    if kind == "Real" and variable.nominal:
        found["nominal"] = _value(variable.nominal, kind)
    return found


def _enumerations(parent: Element, system: System, shown: list[Entry], *, version: int) -> None:
    """Write the definitions of the enumerations that are types of variables."""
    used = [name for name in system.model.enumerations if any(entry.type == name for entry in shown)]
    if not used:
        return
    definitions = SubElement(parent, "TypeDefinitions")
    for name in sorted(used):
        cls = system.model.enumerations[name]
        head = {"name": name} | ({"description": cls.description} if cls.description else {})
        if version == 2:
            owner = SubElement(SubElement(definitions, "SimpleType", head), "Enumeration")
        else:
            owner = SubElement(definitions, "EnumerationType", head)
        for k, (item, description) in enumerate(cls.literals):
            attributes = {"name": item, "value": str(k + 1)}
            SubElement(owner, "Item", attributes | ({"description": description} if description else {}))


def _units(parent: Element, shown: list[Entry]) -> None:
    used: dict[str, set[str]] = {}
    for entry in shown:
        attributes = _typed(entry.variable, entry.type)
        if "unit" in attributes:
            used.setdefault(attributes["unit"], set()).update({attributes.get("displayUnit", "")} - {""})
    if not used:
        return
    definitions = SubElement(parent, "UnitDefinitions")
    for name in sorted(used):
        unit = SubElement(definitions, "Unit", name=name)
        base = base_unit(name)
        if base is not None:
            SubElement(unit, "BaseUnit", base)
        for display in sorted(used[name]):
            SubElement(unit, "DisplayUnit", {"name": display} | (display_unit(display, name) or {}))


def _experiment(parent: Element, system: System) -> None:
    model = system.model
    found = {"startTime": "0.0"}
    for key, value in (
        ("stopTime", model.stop_time),
        ("tolerance", model.tolerance),
        ("stepSize", model.interval),
    ):
        if value is not None:
            found[key] = _value(value, "Real")
    SubElement(parent, "DefaultExperiment", found)


def fmi2(system: System, sources: list[str]) -> str:
    """Return modelDescription.xml for FMI 2.0, with a placeholder for the GUID."""
    shown = entries(system)
    identifier = model_identifier(system)
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": system.model.name,
            "guid": GUID_MARK,
            "description": system.model.description,
            "generationTool": TOOL,
            "variableNamingConvention": "structured",
            "numberOfEventIndicators": str(system.crossings),
        },
    )
    flags = {
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "canNotUseMemoryManagementFunctions": "true",
    }
    interfaces = {"ModelExchange": {}, "CoSimulation": {"canHandleVariableCommunicationStepSize": "true"}}
    for name, extra in interfaces.items():
        element = SubElement(root, name, {"modelIdentifier": identifier, **extra, **flags})
        files = SubElement(element, "SourceFiles")
        for source in sources:
            SubElement(files, "File", name=source)
    _units(root, shown)
    _enumerations(root, system, shown, version=2)
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", name="logStatusError", description="Reason why a call failed")
    _experiment(root, system)
    variables = SubElement(root, "ModelVariables")
    index = {entry.name: k + 1 for k, entry in enumerate(shown)}
    for entry in shown:
        attributes = {"name": entry.name, "valueReference": str(entry.reference)}
        if entry.variable and entry.variable.description:
            attributes["description"] = entry.variable.description
        attributes |= {"causality": entry.causality, "variability": entry.variability}
        if entry.initial:
            attributes["initial"] = entry.initial
        element = SubElement(variables, "ScalarVariable", attributes)
        typed = _typed(entry.variable, entry.type)
        tag = "Enumeration" if entry.type in system.model.enumerations else entry.type
        if tag == "Enumeration":
            typed = {"declaredType": entry.type} | typed
        if entry.start is not None:
            typed["start"] = entry.start
        if entry.derivative_of:
            typed["derivative"] = str(index[entry.derivative_of])
        SubElement(element, tag, typed)
    structure = SubElement(root, "ModelStructure")
    for name, chosen in _structure(shown, system).items():
        if chosen:
            element = SubElement(structure, name)
            for entry in chosen:
                SubElement(element, "Unknown", index=str(index[entry.name]))
    return _text(root)


def _structure(shown: list[Entry], system: System) -> dict[str, list[Entry]]:
    states = set(system.states)
    unknown = [
        entry
        for entry in shown
        if entry.initial == "calculated"
        and (
            entry.causality in ("output", "calculatedParameter")
            or entry.derivative_of
            or entry.name in states
        )
    ]
    return {
        "Outputs": [entry for entry in shown if entry.causality == "output"],
        "Derivatives": [entry for entry in shown if entry.derivative_of],
        "InitialUnknowns": unknown,
    }


def fmi3(system: System) -> str:
    """Return modelDescription.xml for FMI 3.0, with a placeholder for the instantiation token."""
    shown = entries(system)
    identifier = model_identifier(system)
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "3.0",
            "modelName": system.model.name,
            "instantiationToken": GUID_MARK,
            "description": system.model.description,
            "generationTool": TOOL,
            "variableNamingConvention": "structured",
        },
    )
    flags = {"modelIdentifier": identifier, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}
    SubElement(root, "ModelExchange", flags)
    SubElement(root, "CoSimulation", {**flags, "canHandleVariableCommunicationStepSize": "true"})
    _units(root, shown)
    _enumerations(root, system, shown, version=3)
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", name="logStatusError", description="Reason why a call failed")
    _experiment(root, system)
    variables = SubElement(root, "ModelVariables")
    time = len(system.reals) + len(system.ints)
    attributes = {"name": "time", "valueReference": str(time), "causality": "independent"}
    SubElement(
        variables,
        "Float64",
        attributes | {"variability": "continuous", "description": "Simulation time in s"},
    )
    references = {entry.name: entry.reference for entry in shown}
    names = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean"}
    for entry in shown:
        attributes = {"name": entry.name, "valueReference": str(entry.reference)}
        if entry.variable and entry.variable.description:
            attributes["description"] = entry.variable.description
        attributes |= {"causality": entry.causality, "variability": entry.variability}
        if entry.initial:
            attributes["initial"] = entry.initial
        if entry.type in system.model.enumerations:
            attributes["declaredType"] = entry.type
        attributes |= _typed(entry.variable, entry.type)
        if entry.start is not None:
            attributes["start"] = entry.start
        if entry.derivative_of:
            attributes["derivative"] = str(references[entry.derivative_of])
        SubElement(variables, names.get(entry.type, "Enumeration"), attributes)
    indicators = [str(time + 1 + k) for k in range(system.crossings)]
    for k, reference in enumerate(indicators):
        attributes = {"name": f"_indicator_{k + 1}", "valueReference": reference, "causality": "local"}
        attributes |= {"variability": "continuous", "initial": "calculated"}
        SubElement(variables, "Float64", attributes | {"description": "Changes sign at a state event"})
    structure = SubElement(root, "ModelStructure")
    tags = {
        "Outputs": "Output",
        "Derivatives": "ContinuousStateDerivative",
        "InitialUnknowns": "InitialUnknown",
    }
    for group, chosen in _structure(shown, system).items():
        for entry in chosen:
            SubElement(structure, tags[group], valueReference=str(entry.reference))
    for indicator in indicators:
        SubElement(structure, "EventIndicator", valueReference=indicator)
    return _text(root)


def _text(root: Element) -> str:
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"
