"""SSP packages as systems: nested systems are flattened, their names joined by dots.

The meaning of connectors, transformations and parameter bindings is that of SSP 1.0 and 2.0: connections have
no direction of their own, bindings of outer systems override those of inner ones, later ones earlier ones.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

from falsifier.core.arguments import path_of
from falsifier.core.model import INTERFACE_TAGS, Interface, Variable
from falsifier.errors import ModelError, SpecError, did_you_mean
from falsifier.fmu.description.model_description import describe
from falsifier.fmu.description.structure import read_structure, read_units
from falsifier.fmu.process.network import Coupling
from falsifier.fmu.ssp.package import (
    SUFFIXES,
    Package,
    attribute,
    bound_values,
    number,
    opened,
    tag,
    transformation,
    type_and_unit,
    within,
)
from falsifier.fmu.ssp.wiring import SOURCES, Elements, End, title_of
from falsifier.fmu.systems.components import Component, Frame
from falsifier.fmu.systems.system import System

_FMU_TYPE = "application/x-fmu-sharedlibrary"
_INTERFACES: Mapping[str, Interface | None] = {"any": None, **{t: i for i, t in INTERFACE_TAGS.items()}}
_NESTED_TYPES = ("application/x-ssp-definition", "application/x-ssp-package")
_SINKS = ("input", "parameter")
_KINDS = ("input", "output", "parameter", "calculatedParameter")
# Far more than systems have; packages that refer to each other several times grow like powers.
_MAX_ELEMENTS = 2_000


def read_package(path: str | Path, *, coupling: Coupling | None = None) -> System:
    """Return the system in an SSP package, or in a system description beside its resources.

    Args:
        path: path of an ``.ssp`` or ``.ssd`` file.
        coupling: how the components exchange values; SSP does not say.

    Raises:
        SpecError: in one line, naming the file and what is wrong with it.
    """
    path = path_of("path", path, "the path of an .ssp or .ssd file")
    if not is_package(path):
        raise SpecError(f"{path}: expected the path of an .ssp or .ssd file; FmuModel takes that of an FMU")
    reader = _Reader(str(path))
    try:
        reader.walk_file(Package(path, str(path)), "", ())
    except RecursionError:
        raise SpecError(f"{path}: its systems are nested too deeply; flatten them") from None
    start, stop = reader.times.get("startTime", 0.0), reader.times.get("stopTime")
    if stop is not None and stop <= max(start, 0.0):
        raise SpecError(
            f"{path}: DefaultExperiment: the stop time {stop:g} s must be after the start time {start:g} s, "
            "and after 0, at which simulations start; correct the package, or leave the stop time out"
        )
    found = reader.found
    connections, inputs, outputs = found.wiring()
    values = found.values(inputs, connections.keys())
    if start:
        found.notes.append(f"the package starts at {start:g} s; simulations start at 0")
    try:
        return System(
            found.components,
            connections,
            coupling=coupling or Coupling(),
            frame=Frame(inputs, outputs, tuple(values.items()), stop, tuple(found.notes)),
            name=reader.name or path.stem,
            package=path,
        )
    except (SpecError, ModelError) as error:
        raise SpecError(f"{path}: {error}") from None


def is_package(path: str | Path) -> bool:
    """Whether a path has the name of an SSP package or of a system description."""
    return Path(path).suffix.lower() in SUFFIXES


class _Reader:
    """A walk through nested systems, and what it collects."""

    def __init__(self, shown: str) -> None:
        self.found = Elements(shown)
        self.name = ""
        self.times: dict[str, float] = {}  # those of the default experiment in s, by attribute, if stated
        self._elements: set[str] = set()

    def walk_file(self, package: Package, at: str, above: tuple[Path, ...]) -> None:
        """Collect the elements of a system description that stands for the element at a path."""
        file = package.description
        if (key := file.resolve()) in above:
            raise SpecError(f"{package.shown}: the system contains itself, at {at}; remove a reference")
        shown = package.shown if package.shown.endswith(file.name) else f"{package.shown}: {file.name}"
        with opened(file, shown, "SystemStructureDescription") as root:
            version = root.get("version", "")
            if version[:1] not in ("1", "2"):
                raise SpecError(f"SSP version {version!r}; export it as SSP 1.0 or 2.0")
            system = root.find("{*}System")
            if system is None:
                raise SpecError("it has no System; export it again")
            stated = {k: v for each in root.findall("{*}DefaultExperiment") for k, v in each.attrib.items()}
            with within("DefaultExperiment"):
                times = {k: number(k, v) for k, v in stated.items() if k in ("startTime", "stopTime")}
            if not above:
                self.name, self.times = system.get("name", ""), times
            try:
                self.found.units |= read_units(root, tag="{*}Units/{*}Unit")
            except ValueError as error:
                raise SpecError(f"{error}; correct it") from None
            self._walk(system, at, package, (*above, key))

    def _walk(self, system: Element, at: str, package: Package, above: tuple[Path, ...]) -> None:
        self._declare(system, at)
        children = []
        for child in system.findall("{*}Elements/*"):
            name = child.get("name", "")
            if tag(child) == "SignalDictionaryReference":
                raise SpecError(
                    f"{title_of((at, name))!r} refers to a signal dictionary, which is not supported; "
                    "connect the components directly"
                )
            if tag(child) not in ("Component", "System"):
                continue
            children.append(name)
            path = f"{at}.{name}" if at else name
            if path in self._elements:
                raise self.found.wrong(f"two elements are named {path!r}; rename one of them")
            self._elements.add(path)
            if len(self._elements) > _MAX_ELEMENTS:
                raise self.found.wrong(f"the system has more than {_MAX_ELEMENTS} elements; split it")
            if tag(child) == "System":
                self._walk(child, path, package, above)
            else:
                self._component(child, path, package, above)
        with within(_named(at)):
            for wire in system.findall("{*}Connections/{*}Connection"):
                self._wire(wire, at, children)
        self._bind(system, at, package)

    def _declare(self, element: Element, at: str, variables: Mapping[str, Variable] | None = None) -> None:
        """Note the connectors of an element; those of an FMU must fit its variables."""
        for connector in element.findall("{*}Connectors/{*}Connector"):
            with within(_named(at)):
                name, kind = attribute(connector, "name"), attribute(connector, "kind")
            stated, unit, _ = type_and_unit(connector)
            title = f"the connector {title_of((at, name))}"
            if variables is not None:
                if name not in variables:
                    near = did_you_mean(name, variables)
                    raise self.found.wrong(f"the FMU of {at} has no variable for {title}; {near}")
                self._check_connector(title, kind, stated, unit, variables[name])
                unit = unit or variables[name].unit
            if kind not in _KINDS:
                raise self.found.wrong(f"{title} is of kind {kind!r}; expected one of {', '.join(_KINDS)}")
            self.found.connectors[at, name] = kind, unit

    def _component(self, element: Element, at: str, package: Package, above: tuple[Path, ...]) -> None:
        with within(_named(at)):
            name, source = attribute(element, "name"), attribute(element, "source")
            if not (name and source):
                raise SpecError(
                    f"a component has the name {name!r} and the source {source!r}; neither may be empty"
                )
            type_, implementation = element.get("type", _FMU_TYPE), element.get("implementation", "any")
            if type_ not in (_FMU_TYPE, *_NESTED_TYPES):
                raise SpecError(f"it is of type {type_}; only FMUs and SSP packages are supported")
            if implementation not in _INTERFACES:
                raise SpecError(
                    f"its implementation is {implementation!r}; expected one of {', '.join(_INTERFACES)}"
                )
            file = package.file(source)
            nested = Package(file, f"{package.shown}: {source}") if type_ in _NESTED_TYPES else None
        if nested is not None:
            self._declare(element, at)
            self.walk_file(nested, at, above)
            self._bind(element, at, package)
            return
        try:
            component = self.found.components[at] = Component(file, None, _INTERFACES[implementation])
            description = self.found.descriptions[at] = describe(file, component.sha256)
            self.found.own_units[at] = read_structure(file, component.sha256).units
            self.found.units = {**self.found.own_units[at], **self.found.units}
        except ModelError as error:
            raise self.found.wrong(f"the component {at}: {source}: {error}") from None
        self._declare(element, at, {v.name: v for v in description.info.variables})
        self._bind(element, at, package)

    def _check_connector(self, title: str, kind: str, stated: str, unit: str, variable: Variable) -> None:
        type_ = "integer" if variable.kind == "enumeration" else variable.kind
        for what, own, known, fits in (
            ("of kind", kind, variable.causality, kind == variable.causality),
            ("of type", stated, variable.type or type_, not stated or _kind(stated) == type_),
            ("in", unit, variable.unit, unit == variable.unit or not (unit and variable.unit)),
        ):
            if not fits:
                raise self.found.wrong(
                    f"{title} is {what} {own}, the FMU's variable {what} {known}; state that"
                )

    def _wire(self, wire: Element, at: str, children: Sequence[str]) -> None:
        """Note which end feeds the other; an input connector is a source inside of its own system."""
        ends = [(wire.get(f"{end}Element"), attribute(wire, f"{end}Connector")) for end in ("start", "end")]
        shown = [f"{element}.{name}" if element else name for element, name in ends]
        text = f"the connection {' - '.join(shown)}"
        with within(text):
            change = transformation(wire)
        sources: list[End] = []
        sinks: list[End] = []
        for (element, name), title in zip(ends, shown, strict=True):
            path = at if element is None else f"{at}.{element}" if at else element
            if element is not None and element not in children:
                near = did_you_mean(element, children)
                raise SpecError(f"{text} names the unknown element {element!r}; {near}")
            if (path, name) not in self.found.connectors:
                near = did_you_mean(name, (local for place, local in self.found.connectors if place == path))
                raise SpecError(f"{text} names the unknown connector {title!r}; {near}")
            is_source = self.found.connectors[path, name][0] in (_SINKS if element is None else SOURCES)
            (sources if is_source else sinks).append((path, name))
        if len(sources) != 1:
            both = "outputs" if sources else "inputs"
            raise SpecError(f"{text} joins two {both}; connect an output to an input")
        (source,), (sink,) = sources, sinks
        if self.found.connectors[source][0] == "calculatedParameter":
            raise SpecError(
                f"{text} passes on a calculated parameter, which is not supported; set the parameter in a "
                "parameter set"
            )
        is_held = self.found.connectors[sink][0] == "parameter"
        if is_held and self.found.connectors[source][0] != "parameter":
            raise SpecError(
                f"{text} feeds a parameter, which keeps its value during a simulation; set it in a parameter "
                "set, or connect an input"
            )
        if sink in self.found.steps:
            known = title_of(self.found.steps[sink][0])
            raise SpecError(
                f"{title_of(sink)} is fed by {known} and by {title_of(source)}; remove one of the connections"
            )
        self.found.steps[sink] = source, change

    def _bind(self, element: Element, at: str, package: Package) -> None:
        """Add the values of an element's bindings; called from the inside out, so that outer ones win."""
        with within(_named(at)):
            for name, value in bound_values(element, package).items():
                self.found.given[title_of((at, name))] = value


def _kind(type_name: str) -> str:
    """Return the kind of the values of a connector; tools write enumerations as integers too."""
    if type_name in ("Real", "Float32", "Float64"):
        return "real"
    return type_name.lower() if type_name in ("Boolean", "String") else "integer"


def _named(at: str) -> str:
    return f"the element {at}" if at else "the system"
