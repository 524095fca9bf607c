"""A system as an SSP package: its FMUs, connections and values, and the inputs of a counterexample."""

import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from falsifier.core.model import Variable
from falsifier.counterexamples.export.tables import parameter_set
from falsifier.fmu import System
from falsifier.fmu.systems import SYSTEM, Link, Member, Network

_NAMESPACE = "http://ssp-standard.org/SSP1/SystemStructure"
_SSD, _SSC = f"{{{_NAMESPACE}Description}}", f"{{{_NAMESPACE}Common}}"
# Types of connectors; items of enumerations are numbers here.
_TYPES: Mapping[str, str] = {
    "real": "Real",
    "integer": "Integer",
    "enumeration": "Integer",
    "boolean": "Boolean",
    "string": "String",
}
_FMU_TYPE = "application/x-fmu-sharedlibrary"
_IMPLEMENTATIONS = {"co-simulation": "CoSimulation", "model-exchange": "ModelExchange"}


def write_package(system: System, stop_time: float, resources: Mapping[str, Path], path: Path) -> Path:
    """Write a system as an SSP 1.0 package.

    Conversions of units are written as the transformations that they are. What SSP has no place for is left
    out: steps of components' own, and how values are exchanged.

    Args:
        system: the system.
        stop_time: stop time of the default experiment in s.
        resources: files to add, by name; an ``.ssv`` file among them is bound to the system.
        path: the ``.ssp`` file to write.
    """
    network = system.network
    sources = {m.name: f"resources/{m.folder}_{m.path.name}" for m in network.members}
    for short, name in (("ssd", "Description"), ("ssc", "Common")):
        ElementTree.register_namespace(short, _NAMESPACE + name)
    root = Element(f"{_SSD}SystemStructureDescription", {"version": "1.0", "name": system.name})
    whole = SubElement(root, f"{_SSD}System", {"name": system.name})
    _connectors(whole, [v for v in system.info.inputs if network.places[v.name].member == SYSTEM])
    _bindings(whole, system, [f"resources/{name}" for name in resources if name.endswith(".ssv")])
    elements = SubElement(whole, f"{_SSD}Elements")
    for member in network.members:
        attributes = {
            "name": member.name,
            "source": sources[member.name],
            "type": _FMU_TYPE,
            "implementation": _IMPLEMENTATIONS[member.interface],
        }
        component = SubElement(elements, f"{_SSD}Component", attributes)
        info = member.description.info
        _connectors(component, (*info.inputs, *info.outputs, *info.parameters))
    connections = SubElement(whole, f"{_SSD}Connections")
    for link in network.links:
        _connection(connections, link, network)
    SubElement(root, f"{_SSD}DefaultExperiment", {"startTime": "0.0", "stopTime": repr(stop_time)})
    _write(path, root, {sources[m.name]: m for m in network.members}, resources)
    return path


def _connectors(element: Element, variables: Iterable[Variable]) -> None:
    found = [v for v in variables if not v.alias_of]
    if not found:
        return
    ports = SubElement(element, f"{_SSD}Connectors")
    for variable in found:
        port = SubElement(ports, f"{_SSD}Connector", {"name": variable.name, "kind": variable.causality})
        unit = {"unit": variable.unit} if variable.unit and variable.kind == "real" else {}
        SubElement(port, f"{_SSC}{_TYPES[variable.kind]}", unit)


def _bindings(element: Element, system: System, files: Iterable[str]) -> None:
    """Bind the system's own values, then those of files, which win because they are later."""
    bindings = Element(f"{_SSD}ParameterBindings")
    if system.frame.values:
        values = SubElement(SubElement(bindings, f"{_SSD}ParameterBinding"), f"{_SSD}ParameterValues")
        values.append(parameter_set(dict(system.frame.values), system.name))
    for source in files:
        SubElement(bindings, f"{_SSD}ParameterBinding", {"source": source})
    if len(bindings):
        element.append(bindings)


def _connection(parent: Element, link: Link, network: Network) -> None:
    source = link.source.member
    attributes = {} if source == SYSTEM else {"startElement": network.members[source].name}
    attributes |= {
        "startConnector": link.source.name,
        "endElement": network.members[link.target.member].name,
        "endConnector": link.target.name,
        "suppressUnitConversion": "true",
    }
    connection = SubElement(parent, f"{_SSD}Connection", attributes)
    if (link.factor, link.offset) != (1.0, 0.0):
        numbers = {"factor": repr(link.factor), "offset": repr(link.offset)}
        SubElement(connection, f"{_SSC}LinearTransformation", numbers)


def _write(path: Path, root: Element, fmus: Mapping[str, Member], resources: Mapping[str, Path]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        text = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
        package.writestr("SystemStructure.ssd", text)
        for source, member in fmus.items():
            package.write(member.path, source)
        for name, file in resources.items():
            package.write(file, f"resources/{name}")
