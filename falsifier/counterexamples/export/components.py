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
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import tomlkit
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.files import file_name
from falsifier.core.literals import one_line
from falsifier.core.model import Variable
from falsifier.counterexamples.export.tables import (
    InputTable,
    parameter_set,
    start_values,
    write_csv,
    write_json,
)
from falsifier.fmu import FmuModel, System
from falsifier.fmu.process.network import SYSTEM, Link, Member, Network, Place
from falsifier.problem.problem import Problem
from falsifier.stl.lexer import name_text

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
# Folder of an export in which each component has one.
FOLDER = "components"
# Share by which the outputs may leave the range that they had in the system.
_MARGIN = 1e-6

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Seen:
    """What one component saw and did.

    Attributes:
        inputs: its inputs, by their names in the component.
        outputs: its outputs at the ends of its steps.
        start: its parameters and start values.
        step: time between its steps in s.
    """

    inputs: InputTable
    outputs: InputTable
    start: Mapping[str, float | str]
    step: float


def write_components(problem: Problem, candidate: Candidate, directory: Path) -> list[Path]:
    """Write a folder per component of a problem's system; return the files.

    Args:
        problem: a problem whose model is a system.
        candidate: the inputs to simulate.
        directory: folder of the export, in which the folder ``components`` is written.
    """
    assert isinstance(problem.model, System), "only systems have components"
    files = []
    reader = _Reader(problem, problem.model, candidate)
    for position, member in enumerate(problem.model.network.members):
        seen = reader.seen(position)
        folder = directory / FOLDER / file_name(member.name)
        folder.mkdir(parents=True, exist_ok=True)
        model = FmuModel(member.path, member.interface)
        shutil.copyfile(member.path, folder / member.path.name)
        files += [folder / member.path.name, write_json(seen.start, folder / "start_values.json", model)]
        if seen.inputs.columns:
            files.append(write_csv(seen.inputs, folder / "input.csv", model))
        if seen.outputs.columns:
            files.append(write_csv(seen.outputs, folder / "outputs.csv", model))
        text = _spec(member, seen, problem)
        if text:
            files.append(folder / f"{file_name(member.name)}.toml")
            files[-1].write_text(text, encoding="utf-8")
    return files


class _Reader:
    """Finds what a component saw in what is recorded at all communication points of one simulation."""

    def __init__(self, problem: Problem, system: System, candidate: Candidate) -> None:
        network, experiment = system.network, problem.experiment
        self._problem, self._system, self._candidate, self._network = problem, system, candidate, network
        self._position = {member: k for k, member in enumerate(network.order)}
        self._links = {n.target: n for n in network.links}
        stop_time = experiment.stop_time
        self._step = stop_time / round(stop_time / (experiment.step_size or experiment.output_interval))
        outputs = [v.name for v in system.info.outputs if v.kind != "string"]
        outputs += [network.title(n.source) for n in network.links if n.source.member != SYSTEM]
        everything = tuple(dict.fromkeys(outputs))
        self._recorded = system.simulate(
            candidate.signals,
            {**problem.parameters, **candidate.parameters},
            replace(experiment, outputs=everything, output_interval=self._step, step_size=None),
        )

    def seen(self, position: int) -> Seen:
        """Return what the component at this position among the network's members saw."""
        member, own = self._network.members[position], self._every(position)
        ends = np.arange(own, len(self._recorded.times), own)
        times = self._recorded.times
        columns = {}
        for variable in member.description.info.inputs:
            values = None if variable.kind == "string" else self._values(position, variable, ends, own)
            if values is not None:
                columns[variable.name] = np.stack(values, axis=1).ravel()
        grid = np.stack((times[ends - own], times[ends]), axis=1).ravel()
        at = np.concatenate(([0], ends))
        titles = {
            v.name: self._network.title(Place(position, v.name))
            for v in member.description.info.outputs
            if v.kind != "string"
        }
        outputs = {name: self._recorded[title][at] for name, title in titles.items()}
        return Seen(
            InputTable(grid, columns),
            InputTable(times[at], outputs),
            self._start(position),
            own * self._step,
        )

    def _every(self, position: int) -> int:
        step = self._network.members[position].step
        return 1 if step is None else round(step / self._step)

    def _start(self, position: int) -> dict[str, float | str]:
        named = {**dict(self._system.frame.values), **start_values(self._problem, self._candidate)}
        places = ((self._network.places.get(name), value) for name, value in named.items())
        variables = self._network.members[position].description.info
        return {
            place.name: value
            for place, value in places
            if place and place.member == position and variables[place.name].causality != "input"
        }

    def _values(
        self, position: int, variable: Variable, ends: NDArray[np.intp], own: int
    ) -> tuple[Floats, Floats] | None:
        """Return an input at the start and at the end of each step; None if it keeps its start value."""
        link = self._links.get(Place(position, variable.name))
        if link is not None and link.source.member != SYSTEM:
            return self._fed(link, ends, own)
        name = self._network.title(link.source if link else Place(position, variable.name))
        given = self._given(name, self._recorded.times)
        if given is None:
            return None
        values = given if link is None else link.factor * given + link.offset
        follows = self._network.members[position].interface == "model-exchange" and variable.is_continuous
        return values[ends - own], values[ends if follows else ends - own]

    def _given(self, name: str, times: Floats) -> Floats | None:
        if name in self._candidate.signals:
            return self._candidate.signals[name].sample(times)
        value = self._problem.parameters.get(name, self._problem.info[name].start)
        return np.full(times.shape, float(value)) if isinstance(value, int | float) else None

    def _fed(self, link: Link, ends: NDArray[np.intp], own: int) -> tuple[Floats, Floats]:
        """Return a connected input as the worker computes it."""
        title = self._network.title(link.source)
        column, times = self._recorded[title], self._recorded.times
        known = ends - own if self._network.coupling.method == "jacobi" else ends - self._lateness(link)
        every = self._every(link.source.member)
        last = known - known % every
        before = np.maximum(last - every, 0)
        slope = np.zeros(len(ends))
        if link.is_linear:
            slope = (column[last] - column[before]) / np.where(last > 0, every * self._step, np.inf)
        value, since = column[known], times[last]
        starts, stops = times[ends - own], times[ends]
        if self._network.members[link.target.member].interface == "co-simulation":
            starts = stops = 0.5 * (starts + stops)
        first = link.factor * (value + slope * (starts - since)) + link.offset
        return first, link.factor * (value + slope * (stops - since)) + link.offset

    def _lateness(self, link: Link) -> int:
        source, target = self._position[link.source.member], self._position[link.target.member]
        iterates = any(
            first <= min(source, target) and max(source, target) < last for first, last in self._network.loops
        )
        return 0 if source < target or iterates else 1


def _spec(member: Member, seen: Seen, problem: Problem) -> str:
    """Return a spec of the FMU alone, with the system's rights; empty without inputs or outputs."""
    if not seen.outputs.columns or not len(seen.inputs.times):
        return ""
    document = tomlkit.document()
    document.add(
        tomlkit.comment(f"The component {one_line(member.name)} alone, with what it saw in the system:")
    )
    document.add(tomlkit.comment(f"    falsifier simulate {file_name(member.name)}.toml --inputs input.csv"))
    model = {
        "fmu": member.path.name,
        "interface": member.interface,
        "stop_time": float(seen.outputs.times[-1]),
        "output_interval": seen.step,
        "tolerance": problem.experiment.tolerance,
        "allow": list(getattr(problem.model, "allow", ())) or None,
        "deny": list(getattr(problem.model, "deny", ())) or None,
    }
    document["model"] = {key: value for key, value in model.items() if value is not None}
    document["parameters"] = dict(seen.start)
    bounds = []
    for name, column in seen.outputs.columns.items():
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
    out: steps of components' own, and how values are exchanged.

    Args:
        system: the system.
        stop_time: stop time of the default experiment in s.
        resources: files to add, by name; an ``.ssv`` file among them is bound to the system.
        path: the ``.ssp`` file to write.
    """
    network = system.network
    sources = {m.name: f"resources/{k}_{m.path.name}" for k, m in enumerate(network.members)}
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
