"""SSP packages as systems: nested systems are flattened, their names joined by dots.

The meaning of connectors, transformations and parameter bindings is that of SSP 1.0 and 2.0: connections have
no direction of their own, bindings of outer systems override those of inner ones, later ones earlier ones.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from falsifier.core.model import Interface, Variable
from falsifier.errors import ModelError, SpecError, did_you_mean
from falsifier.fmu.description.archive import file_hash
from falsifier.fmu.description.model_description import Description, read_description
from falsifier.fmu.description.structure import Unit, conversion, read_structure
from falsifier.fmu.process.network import Coupling
from falsifier.fmu.ssp.markup import Connector, Part, Structure, Transformation, Wire, parse_structure
from falsifier.fmu.ssp.package import SUFFIXES, Given, Package, bound_values
from falsifier.fmu.systems.components import Component, Connection, Frame
from falsifier.fmu.systems.system import System

_FMU_TYPE = "application/x-fmu-sharedlibrary"
_INTERFACES: Mapping[str, Interface | None] = {
    "any": None,
    "CoSimulation": "co-simulation",
    "ModelExchange": "model-exchange",
}
_NESTED_TYPES = ("application/x-ssp-definition", "application/x-ssp-package")
_SOURCES, _SINKS = ("output", "calculatedParameter"), ("input", "parameter")
_KINDS = ("input", "output", "parameter", "calculatedParameter")
# Far more than systems have; packages that refer to each other several times grow like powers.
_MAX_ELEMENTS = 2_000

# A connector: path of its element, joined by dots (empty: the whole), and its name.
End = tuple[str, str]
# A conversion factor * value + offset that changes nothing.
_UNCHANGED = (1.0, 0.0)


def read_package(path: str | Path, *, coupling: Coupling | None = None) -> System:
    """Return the system in an SSP package, or in a system description beside its resources.

    Args:
        path: path of an ``.ssp`` or ``.ssd`` file.
        coupling: how the components exchange values; SSP does not say.

    Raises:
        SpecError: in one line, naming the file and what is wrong with it.
    """
    path = Path(path)
    reader = _Reader(str(path))
    try:
        structure = reader.walk_file(Package(path, str(path)), "", ())
    except RecursionError:
        raise SpecError(f"{path}: its systems are nested too deeply; flatten them") from None
    start, stop = structure.start_time or 0.0, structure.stop_time
    if stop is not None and stop <= max(start, 0.0):
        raise SpecError(
            f"{path}: DefaultExperiment: the stop time {stop:g} s must be after the start time {start:g} s, "
            "and after 0, at which simulations start; correct the package, or leave the stop time out"
        )
    connections = reader.connections()
    inputs = reader.system_inputs()
    values = reader.values(inputs, connections.keys())
    if start:
        reader.notes.append(f"the package starts at {start:g} s; simulations start at 0")
    outputs, notes = tuple(reader.outputs()), tuple(reader.notes)
    try:
        return System(
            {name: Component(fmu, None, reader.interfaces[name]) for name, fmu in reader.fmus.items()},
            connections,
            coupling=coupling or Coupling(),
            frame=Frame(inputs, outputs, tuple(values.items()), stop, notes),
            name=structure.root.name or path.stem,
            package=path,
        )
    except (SpecError, ModelError) as error:
        raise SpecError(f"{path}: {error}") from None


def is_package(path: str | Path) -> bool:
    """Whether a path has the name of an SSP package or of a system description."""
    return Path(path).suffix in SUFFIXES


class _Reader:
    """What a walk through nested systems collects, and what follows from it.

    Args:
        shown: name of the package in messages.

    Attributes:
        fmus: path of the FMU of each component.
        interfaces: interface that the package states for it.
        notes: what the user should know, one sentence each.
    """

    def __init__(self, shown: str) -> None:
        self._shown = shown
        self.fmus: dict[str, Path] = {}
        self.interfaces: dict[str, Interface | None] = {}
        self.notes: list[str] = []
        self._elements: set[str] = set()
        self._descriptions: dict[str, Description] = {}
        self._connectors: dict[End, Connector] = {}
        # Where the value of a connector comes from, in the direction of the signal.
        self._steps: dict[End, tuple[End, Transformation]] = {}
        self._units: dict[str, Unit] = {}
        self._given: dict[str, Given] = {}

    def walk_file(self, package: Package, at: str, above: tuple[str, ...]) -> Structure:
        """Collect the elements of a system description that stands for the element at a path."""
        if package.key in above:
            raise SpecError(
                f"{package.shown}: the system contains itself, at {at}; remove one of the references"
            )
        structure = parse_structure(package.structure(), f"{package.shown}: {package.description}")
        self._units |= structure.units
        self._walk(structure.root, at, package, (*above, package.key))
        return structure

    def connections(self) -> dict[str, Connection | str]:
        """Return where the inputs of components get their values."""
        found: dict[str, Connection | str] = {}
        for end, source, (factor, offset) in self._fed_inputs():
            found[_title(end)] = Connection(_title(source), factor, offset)
            if (factor, offset) != _UNCHANGED:
                shown = f"* {factor:.6g} {offset:+.6g}"
                self.notes.append(f"{_title(source)} -> {_title(end)}: {shown}, as the package says")
        return found

    def system_inputs(self) -> tuple[Variable, ...]:
        """Return the inputs of the whole: each as its first target, with the connector's own unit."""
        found: dict[End, Variable] = {}
        for target, end, (factor, offset) in self._fed_inputs():
            if end in found or self._is_component(end):
                continue
            first = self._descriptions[target[0]].info[target[1]]
            limits = [None if x is None else (x - offset) / factor for x in (first.low, first.high)]
            low, high = limits if factor > 0 else limits[::-1]
            start = (float(first.start) - offset) / factor if isinstance(first.start, int | float) else 0.0
            unit = self._unit(end) or first.unit
            found[end] = replace(
                first, name=_title(end), unit=unit, low=low, high=high, start=start, alias_of=""
            )
        return tuple(found.values())

    def outputs(self) -> Iterator[tuple[str, str]]:
        """Yield the outputs of the whole that pass an output of a component unchanged, with its name."""
        for end, connector in self._connectors.items():
            if end[0] == "" and connector.kind == "output":
                source, found = self._traced(end)
                if found == _UNCHANGED and self._is_component(source):
                    yield end[1], _title(source)

    def values(self, inputs: tuple[Variable, ...], connected: Collection[str]) -> dict[str, float | str]:
        """Return the values of variables; those that name nothing are noted."""
        found: dict[str, float | str] = {}
        own = {v.name: v for v in inputs}
        for name, given in self._given.items():
            targets = list(self._targets(name))
            if name in own:
                found[name] = given.number(own[name], self._shown)
            elif not targets:
                self.notes.append(f"the parameter {name} of the package names nothing that can be set")
            for end in targets:
                description = self._descriptions[end[0]]
                if _title(end) in connected:
                    continue
                if refusal := description.slots[end[1]].refusal:
                    raise self._wrong(f"the parameter {_title(end)} cannot be set: {refusal}")
                found[_title(end)] = given.number(description.info[end[1]], self._shown)
        return found

    def _wrong(self, what: str) -> SpecError:
        return SpecError(f"{self._shown}: {what}")

    def _walk(self, part: Part, at: str, package: Package, above: tuple[str, ...]) -> None:
        self._declare(part, at)
        for child in part.parts:
            path = f"{at}.{child.name}" if at else child.name
            if path in self._elements:
                raise self._wrong(f"two elements are named {path!r}; rename one of them")
            self._elements.add(path)
            if len(self._elements) > _MAX_ELEMENTS:
                raise self._wrong(f"the system has more than {_MAX_ELEMENTS} elements; split it")
            if not child.source:
                self._walk(child, path, package, above)
            elif child.type in _NESTED_TYPES:
                self._declare(child, path)
                self.walk_file(package.nested(child.source), path, above)
                self._bind(child, path, package)
            else:
                self._component(child, path, package)
        for wire in part.wires:
            self._wire(wire, part, at)
        self._bind(part, at, package)

    def _declare(self, part: Part, at: str) -> None:
        for connector in part.connectors:
            if connector.kind not in _KINDS:
                raise self._wrong(
                    f"the connector {_title((at, connector.name))} is of kind {connector.kind!r}; expected "
                    f"one of {', '.join(_KINDS)}"
                )
            self._connectors[at, connector.name] = connector

    def _component(self, part: Part, at: str, package: Package) -> None:
        if part.type != _FMU_TYPE:
            raise self._wrong(f"the component {at} is of type {part.type}; only FMUs are supported")
        if part.implementation not in _INTERFACES:
            known = ", ".join(_INTERFACES)
            raise self._wrong(
                f"the implementation of {at} is {part.implementation!r}; expected one of {known}"
            )
        fmu = self.fmus[at] = package.file(part.source)
        self.interfaces[at] = _INTERFACES[part.implementation]
        try:
            description = self._descriptions[at] = read_description(fmu)
        except ModelError as error:
            raise self._wrong(f"{part.source}: {error}") from None
        self._units = {**read_structure(fmu, file_hash(fmu)).units, **self._units}
        variables = {v.name: v for v in description.info.variables}
        for connector in part.connectors:
            if connector.name not in variables:
                title, near = _title((at, connector.name)), did_you_mean(connector.name, variables)
                raise self._wrong(f"the FMU of {at} has no variable for the connector {title}; {near}")
            self._check_connector(connector, variables[connector.name], at)
        self._declare(part, at)
        self._bind(part, at, package)

    def _check_connector(self, connector: Connector, variable: Variable, at: str) -> None:
        title = f"the connector {_title((at, connector.name))}"
        if variable.causality != connector.kind:
            raise self._wrong(
                f"{title} is of kind {connector.kind}, but the FMU's variable has the causality "
                f"{variable.causality}; use the FMU's"
            )
        kind = "integer" if variable.kind == "enumeration" else variable.kind
        if connector.type and _kind(connector.type) != kind:
            raise self._wrong(
                f"{title} is of type {connector.type}, but the FMU's variable of type "
                f"{variable.type or variable.kind}; state the FMU's type"
            )
        if connector.unit and variable.unit and connector.unit != variable.unit:
            raise self._wrong(
                f"{title} is in {connector.unit}, but the FMU's variable in {variable.unit}; state the "
                "FMU's unit"
            )

    def _wire(self, wire: Wire, system: Part, at: str) -> None:
        """Note which end feeds the other; an input connector is a source inside of its own system."""
        shown = [f"{element}.{name}" if element else name for element, name in (wire.start, wire.end)]
        text = f"the connection {' - '.join(shown)}"
        sources: list[End] = []
        sinks: list[End] = []
        for (element, name), title in zip((wire.start, wire.end), shown, strict=True):
            path = at if element is None else f"{at}.{element}" if at else element
            children = [child.name for child in system.parts]
            if element is not None and element not in children:
                near = did_you_mean(element, children)
                raise self._wrong(f"{text} names the unknown element {element!r}; {near}")
            connector = self._connectors.get((path, name))
            if connector is None:
                near = did_you_mean(name, (local for place, local in self._connectors if place == path))
                raise self._wrong(f"{text} names the unknown connector {title!r}; {near}")
            is_source = connector.kind in (_SINKS if element is None else _SOURCES)
            (sources if is_source else sinks).append((path, name))
        if len(sources) != 1:
            both = "outputs" if sources else "inputs"
            raise self._wrong(f"{text} joins two {both}; connect an output to an input")
        (source,), (sink,) = sources, sinks
        if self._connectors[source].kind == "calculatedParameter":
            raise self._wrong(
                f"{text} passes on a calculated parameter, which is not supported; set the parameter in a "
                "parameter set"
            )
        if sink in self._steps:
            known = _title(self._steps[sink][0])
            raise self._wrong(
                f"{_title(sink)} is fed by {known} and by {_title(source)}; remove one of the connections"
            )
        self._steps[sink] = source, wire.transformation

    def _bind(self, part: Part, at: str, package: Package) -> None:
        """Add the values of an element's bindings; called from the inside out, so that outer ones win."""
        for name, value in bound_values(part.bindings, package, self._units).items():
            self._given[f"{at}.{name}" if at else name] = value

    def _is_component(self, end: End) -> bool:
        return end[0] in self.fmus

    def _fed_inputs(self) -> Iterator[tuple[End, End, tuple[float, float]]]:
        """Yield the inputs of components that are connected, where each begins, and the conversion."""
        for end, connector in self._connectors.items():
            if connector.kind == "input" and self._is_component(end) and end in self._steps:
                yield end, *self._traced(end)

    def _traced(self, end: End) -> tuple[End, tuple[float, float]]:
        """Follow the connections back from a connector; return where they begin, and the conversion."""
        chain: list[tuple[End, Transformation]] = []
        at = end
        while at in self._steps:
            source, transformation = self._steps[at]
            chain.append((at, transformation))
            at = source
            if any(at == passed for passed, _ in chain):
                circle = " -> ".join(_title(passed) for passed, _ in chain)
                raise self._wrong(f"connectors feed each other in a circle: {circle}; remove one")
        factor, offset, unit, before = 1.0, 0.0, self._unit(at), at
        for target, transformation in reversed(chain):
            wanted = self._unit(target)
            if not transformation.suppress:
                found = conversion(unit, wanted, (self._units, self._units))
                if found is None:
                    raise self._wrong(
                        f"{_title(before)} is in {unit}, {_title(target)} in {wanted}; the package defines "
                        "no conversion; define both units, or suppress the conversion"
                    )
                factor, offset = found[0] * factor, found[0] * offset + found[1]
            factor = transformation.factor * factor
            offset = transformation.factor * offset + transformation.offset
            unit, before = wanted or unit, target
        return at, (factor, offset)

    def _unit(self, end: End) -> str:
        connector = self._connectors[end]
        if connector.unit or not self._is_component(end):
            return connector.unit
        return self._descriptions[end[0]].info[end[1]].unit

    def _targets(self, name: str) -> Iterator[End]:
        """Yield the variables that a name means: one of a component, or what a parameter connector feeds."""
        for element in sorted(self.fmus, key=len, reverse=True):
            local = name.removeprefix(f"{element}.")
            if local != name and local in self._descriptions[element].slots:
                yield element, local
                return
        for end in self._steps:
            if self._is_component(end) and self._connectors[end].kind == "parameter":
                source, found = self._traced(end)
                if _title(source) == name and found == _UNCHANGED:
                    yield end


def _kind(type_name: str) -> str:
    """Return the kind of the values of a connector; tools write enumerations as integers too."""
    if type_name in ("Real", "Float32", "Float64"):
        return "real"
    return type_name.lower() if type_name in ("Boolean", "String") else "integer"


def _title(end: End) -> str:
    return f"{end[0]}.{end[1]}" if end[0] else end[1]
