"""A system as an SSP package, and what each of its components saw at its ports, to simulate it alone.

::

    components/NAME/MODEL.fmu           copy of the component's FMU
    components/NAME/input.csv           its inputs, connected ones too
    components/NAME/outputs.csv         its outputs in the system
    components/NAME/start_values.json   its parameters and start values
    components/NAME/NAME.toml           a spec of the FMU alone, for ``falsifier simulate``
"""

import shutil
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import tomlkit
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.files import file_name, write_whole
from falsifier.core.literals import one_line
from falsifier.core.model import INTERFACE_TAGS, Variable
from falsifier.core.trajectory import Trajectory
from falsifier.counterexamples.export import tables
from falsifier.counterexamples.export.tables import InputTable
from falsifier.evaluation.evaluate import numbers
from falsifier.fmu import FmuModel, System
from falsifier.fmu.process.network import SYSTEM, Link, Member, Network, Place
from falsifier.fmu.systems.step_order import late_links
from falsifier.problem.problem import Problem
from falsifier.stl.lexer import name_text

_NAMESPACE = "http://ssp-standard.org/SSP1/SystemStructure"
_SSD, _SSC = f"{{{_NAMESPACE}Description}}", f"{{{_NAMESPACE}Common}}"
_FMU_TYPE = "application/x-fmu-sharedlibrary"
# Folder of an export in which each component has one.
FOLDER = "components"
# Share by which the outputs may leave the range that they had in the system.
_MARGIN = 1e-6


def write_components(problem: Problem, candidate: Candidate, directory: Path) -> list[Path]:
    """Write a folder per component of a problem's system, below that of the export; return the files."""
    system, experiment = problem.model, problem.experiment
    assert isinstance(system, System), "only systems have components"
    network = system.network
    # What is omitted may be NaN; what is connected is not.
    kept = {*experiment.outputs, *(network.title(link.source) for link in network.links)}
    places = [
        Place(k, variable.name)
        for k, member in enumerate(network.members)
        for variable in (*member.description.info.inputs, *member.description.info.outputs)
        if variable.kind != "string"
        and (variable.causality == "input" or network.title(Place(k, variable.name)) in kept)
    ]
    step = experiment.stop_time / round(experiment.stop_time / experiment.step)
    recorded = system.simulate(
        candidate.signals,
        numbers(problem, candidate),
        replace(experiment, outputs=tuple(map(network.title, places)), output_interval=step, step_size=None),
    )
    given = {**dict(system.frame.values), **tables.start_values(problem, candidate)}
    files = []
    for position, member in enumerate(network.members):
        inputs, outputs = _seen(network, position, recorded)
        variables = member.description.info
        own = [(place, v) for name, v in given.items() if (place := network.places.get(name))]
        start = {
            place.name: value
            for place, value in own
            if place.member == position and variables[place.name].causality != "input"
        }
        folder = directory / FOLDER / file_name(member.name)
        folder.mkdir(parents=True, exist_ok=True)
        model = FmuModel(member.path, member.interface)
        shutil.copyfile(member.path, folder / member.path.name)
        files += [folder / member.path.name, tables.write_json(start, folder / "start_values.json", model)]
        if inputs.columns:
            files.append(tables.write_csv(inputs, folder / "input.csv", model))
        if outputs.columns:
            files.append(tables.write_csv(outputs, folder / "outputs.csv", model))
            spec = _spec(member, outputs, start, problem)
            files.append(write_whole(folder / f"{file_name(member.name)}.toml", spec))
    return files


def _seen(network: Network, position: int, recorded: Trajectory) -> tuple[InputTable, InputTable]:
    """Return the inputs that a component had over each of its steps, and its outputs at their ends.

    ``recorded`` has all inputs of all components, and their outputs that are not omitted, at all
    communication points.
    """
    member = network.members[position]
    every = 1 if member.step is None else round(member.step / recorded.step)
    ends = np.arange(every, len(recorded.times), every)
    starts, at = ends - every, np.concatenate(([0], ends))
    links = {link.target: link for link in network.links}
    inputs, outputs = {}, {}
    for variable in member.description.info.inputs:
        place = Place(position, variable.name)
        if variable.kind == "string":
            continue
        # At the end of a step, the input is what the component had during it.
        column, link = recorded[network.title(place)], links.get(place)
        first = column[ends]
        if member.interface == "model-exchange" and variable.is_continuous:
            if link is None or link.source.member == SYSTEM:
                first = column[starts]
            elif link.is_linear:
                length = recorded.times[ends] - recorded.times[starts]
                first = column[ends] - link.factor * _slope(network, link, recorded, starts, ends) * length
        inputs[variable.name] = np.stack((first, column[ends]), axis=1).ravel()
    for variable in member.description.info.outputs:
        if (title := network.title(Place(position, variable.name))) in recorded.names:
            outputs[variable.name] = recorded[title][at]
    times = recorded.times
    grid = np.stack((times[starts], times[ends]), axis=1).ravel()
    return InputTable(grid, inputs), InputTable(times[at], outputs)


def _slope(
    network: Network, link: Link, recorded: Trajectory, starts: NDArray[np.intp], ends: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the slope with which a connection goes on in each step: that of its source's last step."""
    column, times = recorded[network.title(link.source)], recorded.times
    known = ends
    if network.coupling.method == "jacobi":
        known = starts
    elif link in late_links(network.links, network.order, network.loops):
        known = ends - 1
    step = network.members[link.source.member].step
    every = 1 if step is None else round(step / recorded.step)
    last = known - known % every
    before = np.maximum(last - every, 0)
    slope: NDArray[np.float64] = (column[last] - column[before]) / np.where(
        last > 0, times[last] - times[before], np.inf
    )
    return slope


def _spec(member: Member, outputs: InputTable, start: Mapping[str, float | str], problem: Problem) -> str:
    """Return a spec of the FMU alone, with the system's rights."""
    document = tomlkit.document()
    document.add(
        tomlkit.comment(f"The component {one_line(member.name)} alone, with what it saw in the system:")
    )
    document.add(tomlkit.comment(f"    falsifier simulate {file_name(member.name)}.toml --inputs input.csv"))
    numbers = [v.name for v in member.description.info.outputs if v.kind != "string"]
    model = {
        "fmu": member.path.name,
        "interface": member.interface,
        "stop_time": float(outputs.times[-1]),
        "output_interval": float(outputs.times[1]),
        "tolerance": problem.experiment.tolerance,
        "omit": [name for name in numbers if name not in outputs.columns] or None,
        "allow": list(getattr(problem.model, "allow", ())) or None,
        "deny": list(getattr(problem.model, "deny", ())) or None,
    }
    document["model"] = {key: value for key, value in model.items() if value is not None}
    document["parameters"] = dict(start)
    bounds = []
    for name, column in outputs.columns.items():
        low, high = float(column.min()), float(column.max())
        low, high = low - _MARGIN * max(1.0, abs(low)), high + _MARGIN * max(1.0, abs(high))
        bounds.append(f"{name_text(name)} >= {low!r} and {name_text(name)} <= {high!r}")
    requirement = {
        "formula": f"G ({' and '.join(bounds)})",
        "description": "The outputs stay in the range that they had in the system.",
    }
    document["requirements"] = {"as_in_the_system": requirement}
    return tomlkit.dumps(document)


def write_package(system: System, stop_time: float, resources: Mapping[str, Path], path: Path) -> Path:
    """Write a system as an SSP 1.0 package.

    Conversions of units are written as the transformations that they are. What SSP has no place for is left
    out: steps of components' own, and how values are exchanged. The stop time in s is the
    default experiment's. Of the resources, which are files by name, an ``.ssv`` file is bound to the system.
    """
    network = system.network
    sources = {m.name: f"resources/{k}_{m.path.name}" for k, m in enumerate(network.members)}
    for short, name in (("ssd", "Description"), ("ssc", "Common")):
        ElementTree.register_namespace(short, _NAMESPACE + name)
    root = Element(f"{_SSD}SystemStructureDescription", {"version": "1.0", "name": system.name})
    whole = SubElement(root, f"{_SSD}System", {"name": system.name})
    inputs = [v for v in system.info.inputs if network.places[v.name].member == SYSTEM]
    named = [replace(system.info[n], causality="output", alias_of="") for n, _ in system.frame.outputs]
    _connectors(whole, (*inputs, *named))
    _bindings(whole, system, [f"resources/{name}" for name in resources if name.endswith(".ssv")])
    elements = SubElement(whole, f"{_SSD}Elements")
    for member in network.members:
        attributes = {
            "name": member.name,
            "source": sources[member.name],
            "type": _FMU_TYPE,
            "implementation": INTERFACE_TAGS[member.interface],
        }
        component = SubElement(elements, f"{_SSD}Component", attributes)
        info = member.description.info
        _connectors(component, (*info.inputs, *info.outputs, *info.parameters))
    connections = SubElement(whole, f"{_SSD}Connections")
    for link in network.links:
        _connection(connections, network, link.source, link.target, link.factor, link.offset)
    for name, meant in system.frame.outputs:
        _connection(connections, network, network.places[meant], Place(SYSTEM, name))
    SubElement(root, f"{_SSD}DefaultExperiment", {"startTime": "0.0", "stopTime": repr(stop_time)})
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        text = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
        package.writestr("SystemStructure.ssd", text)
        for member in network.members:
            package.write(member.path, sources[member.name])
        for name, file in resources.items():
            package.write(file, f"resources/{name}")
    return path


def _connectors(element: Element, variables: Iterable[Variable]) -> None:
    found = [v for v in variables if not v.alias_of]
    if not found:
        return
    ports = SubElement(element, f"{_SSD}Connectors")
    for variable in found:
        port = SubElement(ports, f"{_SSD}Connector", {"name": variable.name, "kind": variable.causality})
        # A component's is that of the FMU, whose definition of the unit the package would have to repeat.
        unit = {"unit": variable.unit} if variable.unit and element.tag == f"{_SSD}System" else {}
        kind = "integer" if variable.kind == "enumeration" else variable.kind  # items are numbers here
        SubElement(port, f"{_SSC}{kind.capitalize()}", unit if kind == "real" else {})


def _bindings(element: Element, system: System, files: Iterable[str]) -> None:
    """Bind the system's own values, then those of files, which win because they are later."""
    bindings = Element(f"{_SSD}ParameterBindings")
    if system.frame.values:
        values = SubElement(SubElement(bindings, f"{_SSD}ParameterBinding"), f"{_SSD}ParameterValues")
        values.append(tables.parameter_set(dict(system.frame.values), system.name, system.info, named=False))
    for source in files:
        SubElement(bindings, f"{_SSD}ParameterBinding", {"source": source})
    if len(bindings):
        element.append(bindings)


def _connection(
    parent: Element, network: Network, source: Place, target: Place, factor: float = 1.0, offset: float = 0.0
) -> None:
    attributes = {}
    for end, place in (("start", source), ("end", target)):
        if place.member != SYSTEM:
            attributes[f"{end}Element"] = network.members[place.member].name
        attributes[f"{end}Connector"] = place.name
    connection = SubElement(parent, f"{_SSD}Connection", attributes | {"suppressUnitConversion": "true"})
    if (factor, offset) != (1.0, 0.0):
        numbers = {"factor": repr(factor), "offset": repr(offset)}
        SubElement(connection, f"{_SSC}LinearTransformation", numbers)
