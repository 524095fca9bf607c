"""SSP packages as systems: nested systems are flattened, their names joined by dots.

The meaning of connectors, transformations and parameter bindings is that of SSP 1.0 and 2.0: connections have
no direction of their own, bindings of outer systems override those of inner ones, later ones earlier ones.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

from falsifier.core.arguments import path_of
from falsifier.core.model import INTERFACE_TAGS, Interface, Variable
from falsifier.errors import ModelError, SpecError, did_you_mean
from falsifier.fmu.description.model_description import Description, describe
from falsifier.fmu.description.structure import Unit, conversion, read_structure, read_units
from falsifier.fmu.process.network import Coupling
from falsifier.fmu.ssp.package import (
    SUFFIXES,
    Given,
    Package,
    Transformation,
    attribute,
    bound_values,
    number,
    opened,
    tag,
    transformation,
    type_and_unit,
    within,
)
from falsifier.fmu.systems.components import Component, Connection, Frame
from falsifier.fmu.systems.system import System
from falsifier.stl.lexer import name_text

_FMU_TYPE = "application/x-fmu-sharedlibrary"
_INTERFACES: Mapping[str, Interface | None] = {"any": None, **{t: i for i, t in INTERFACE_TAGS.items()}}
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
    connections, inputs, outputs = reader.wiring()
    values = reader.values(inputs, connections.keys())
    if start:
        reader.notes.append(f"the package starts at {start:g} s; simulations start at 0")
    try:
        return System(
            reader.components,
            connections,
            coupling=coupling or Coupling(),
            frame=Frame(inputs, outputs, tuple(values.items()), stop, tuple(reader.notes)),
            name=reader.name or path.stem,
            package=path,
        )
    except (SpecError, ModelError) as error:
        raise SpecError(f"{path}: {error}") from None


def is_package(path: str | Path) -> bool:
    """Whether a path has the name of an SSP package or of a system description."""
    return Path(path).suffix.lower() in SUFFIXES


class _Reader:
    """What a walk through nested systems collects, and what follows from it.

    ``times``: those of the default experiment in s, by attribute, if stated; ``notes``: for the user.
    """

    def __init__(self, shown: str) -> None:
        self._shown = shown
        self.name = ""
        self.times: dict[str, float] = {}
        self.components: dict[str, Component] = {}
        self.notes: list[str] = []
        self._elements: set[str] = set()
        self._descriptions: dict[str, Description] = {}
        # Kind and unit of each connector.
        self._connectors: dict[End, tuple[str, str]] = {}
        # Where the value of a connector comes from, in the direction of the signal.
        self._steps: dict[End, tuple[End, Transformation]] = {}
        self._units: dict[str, Unit] = {}
        # Those that an FMU defines, by component: another may mean something else by the same name.
        self._own_units: dict[str, Mapping[str, Unit]] = {}
        self._given: dict[str, Given] = {}

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
                self._units |= read_units(root, tag="{*}Units/{*}Unit")
            except ValueError as error:
                raise SpecError(f"{error}; correct it") from None
            self._walk(system, at, package, (*above, key))

    def wiring(self) -> tuple[dict[str, Connection | str], tuple[Variable, ...], tuple[tuple[str, str], ...]]:
        """Return where the inputs of components get their values, and the inputs and outputs of the whole.

        An input of the whole is like its first target, or the first of whole numbers, within the limits of
        all. Outputs of the whole pass an output of a component unchanged; they come with its name.
        """
        connections: dict[str, Connection | str] = {}
        inputs: dict[End, Variable] = {}
        outputs: list[tuple[str, str]] = []
        for end, (kind, _) in self._connectors.items():
            if kind == "output" and not end[0]:
                source, (factor, offset) = self._traced(end)
                if (factor, offset) == _UNCHANGED and source[0] in self.components:
                    outputs.append((end[1], _title(source)))
                    continue
                value = f"{name_text(_title(source))}{_conversion_text(factor, offset)}"
                why = "nothing feeds it" if source == end else f"write {value} in formulas"
                self.notes.append(f"the output {end[1]} of the package is left out: {why}")
            elif kind == "input" and end[0] in self.components and end in self._steps:
                source, (factor, offset) = self._traced(end)
                connections[_title(end)] = Connection(_title(source), factor, offset)
                if (factor, offset) != _UNCHANGED:
                    shown = f"{_title(source)} -> {_title(end)}:{_conversion_text(factor, offset)}"
                    self.notes.append(f"{shown}, by units and transformations of the package")
                if source[0] not in self.components:
                    fed = self._passing(source, end, factor, offset)
                    inputs[source] = self._joint(inputs.get(source, fed), fed)
        return connections, tuple(inputs.values()), tuple(outputs)

    def values(self, inputs: Sequence[Variable], connected: Collection[str]) -> dict[str, float | str]:
        """Return the values of variables; those that name nothing are noted."""
        found: dict[str, float | str] = {}
        own, fed = {v.name: v for v in inputs}, {_title(end) for end in self._steps}
        for name, given in self._given.items():
            targets = list(self._targets(name))
            if name in own:
                found[name] = self._value(given, own[name])
            elif not targets and name not in fed:  # what feeds a connector replaces its value
                self.notes.append(f"the parameter {name} of the package names nothing that can be set")
            for end, source, (factor, offset) in targets:
                if _title(end) in connected:
                    continue
                if refusal := self._descriptions[end[0]].info[end[1]].refusal:
                    raise self._wrong(f"the parameter {_title(end)} cannot be set: {refusal}")
                value = self._value(given, self._passing(source, end, factor, offset))
                found[_title(end)] = value if isinstance(value, str) else factor * value + offset
        return found

    def _wrong(self, what: str) -> SpecError:
        return SpecError(what, file=self._shown)

    def _walk(self, system: Element, at: str, package: Package, above: tuple[Path, ...]) -> None:
        self._declare(system, at)
        children = []
        for child in system.findall("{*}Elements/*"):
            name = child.get("name", "")
            if tag(child) == "SignalDictionaryReference":
                raise SpecError(
                    f"{_title((at, name))!r} refers to a signal dictionary, which is not supported; connect "
                    "the components directly"
                )
            if tag(child) not in ("Component", "System"):
                continue
            children.append(name)
            path = f"{at}.{name}" if at else name
            if path in self._elements:
                raise self._wrong(f"two elements are named {path!r}; rename one of them")
            self._elements.add(path)
            if len(self._elements) > _MAX_ELEMENTS:
                raise self._wrong(f"the system has more than {_MAX_ELEMENTS} elements; split it")
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
            title = f"the connector {_title((at, name))}"
            if variables is not None:
                if name not in variables:
                    near = did_you_mean(name, variables)
                    raise self._wrong(f"the FMU of {at} has no variable for {title}; {near}")
                self._check_connector(title, kind, stated, unit, variables[name])
                unit = unit or variables[name].unit
            if kind not in _KINDS:
                raise self._wrong(f"{title} is of kind {kind!r}; expected one of {', '.join(_KINDS)}")
            self._connectors[at, name] = kind, unit

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
            component = self.components[at] = Component(file, None, _INTERFACES[implementation])
            description = self._descriptions[at] = describe(file, component.sha256)
            self._own_units[at] = read_structure(file, component.sha256).units
            self._units = {**self._own_units[at], **self._units}
        except ModelError as error:
            raise self._wrong(f"the component {at}: {source}: {error}") from None
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
                raise self._wrong(f"{title} is {what} {own}, the FMU's variable {what} {known}; state that")

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
            if (path, name) not in self._connectors:
                near = did_you_mean(name, (local for place, local in self._connectors if place == path))
                raise SpecError(f"{text} names the unknown connector {title!r}; {near}")
            is_source = self._connectors[path, name][0] in (_SINKS if element is None else _SOURCES)
            (sources if is_source else sinks).append((path, name))
        if len(sources) != 1:
            both = "outputs" if sources else "inputs"
            raise SpecError(f"{text} joins two {both}; connect an output to an input")
        (source,), (sink,) = sources, sinks
        if self._connectors[source][0] == "calculatedParameter":
            raise SpecError(
                f"{text} passes on a calculated parameter, which is not supported; set the parameter in a "
                "parameter set"
            )
        is_held = self._connectors[sink][0] == "parameter"
        if is_held and self._connectors[source][0] != "parameter":
            raise SpecError(
                f"{text} feeds a parameter, which keeps its value during a simulation; set it in a parameter "
                "set, or connect an input"
            )
        if sink in self._steps:
            known = _title(self._steps[sink][0])
            raise SpecError(
                f"{_title(sink)} is fed by {known} and by {_title(source)}; remove one of the connections"
            )
        self._steps[sink] = source, change

    def _bind(self, element: Element, at: str, package: Package) -> None:
        """Add the values of an element's bindings; called from the inside out, so that outer ones win."""
        with within(_named(at)):
            for name, value in bound_values(element, package).items():
                self._given[_title((at, name))] = value

    def _traced(self, end: End) -> tuple[End, tuple[float, float]]:
        """Follow the connections back from a connector; return where they begin, and the conversion."""
        chain: list[tuple[End, Transformation]] = []
        at = end
        while at in self._steps:
            source, change = self._steps[at]
            chain.append((at, change))
            at = source
            if any(at == passed for passed, _ in chain):
                circle = " -> ".join(_title(passed) for passed, _ in chain)
                raise self._wrong(f"connectors feed each other in a circle: {circle}; remove one")
        if at != end and at[0] not in self.components and self._connectors[at][0] in _SOURCES:
            raise self._wrong(
                f"{_title(end)} is fed by the output {_title(at)}, which nothing feeds; connect that one too"
            )
        factor, offset, unit, before, stating = 1.0, 0.0, self._connectors[at][1], at, at
        # Connectors do not say so; the variables at both ends do.
        of_fmus = [self._descriptions[e].info[name] for e, name in (at, end) if e in self.components]
        is_relative = any(variable.is_relative for variable in of_fmus)
        for target, change in reversed(chain):
            wanted = self._connectors[target][1]
            if not change.suppress:
                known = self._units_of(stating), self._units_of(target)
                found = conversion(unit, wanted, known, is_relative=is_relative)
                if found is None:
                    raise self._wrong(
                        f"{_title(before)} is in {unit}, {_title(target)} in {wanted}; the package defines "
                        "no conversion; define both units, or suppress the conversion"
                    )
                factor, offset = found[0] * factor, found[0] * offset + found[1]
            factor = change.factor * factor
            offset = change.factor * offset + change.offset
            unit, before, stating = wanted or unit, target, target if wanted else stating
        return at, (factor, offset)

    def _units_of(self, end: End) -> Mapping[str, Unit]:
        return {**self._units, **self._own_units.get(end[0], {})}

    def _joint(self, one: Variable, other: Variable) -> Variable:
        both = zip(one.limits, other.limits, strict=True)
        lows, highs = ([x for x in ends if x is not None] for ends in both)
        first = other if one.kind == "real" != other.kind else one
        if lows and highs and min(highs) < max(lows) and one is not other:
            self.notes.append(f"no value of {one.name} is within the limits of all that it feeds")
            return replace(first, low=one.low, high=one.high)
        return replace(first, low=max(lows, default=None), high=min(highs, default=None))

    def _passing(self, end: End, target: End, factor: float, offset: float) -> Variable:
        """Return a connector as a variable whose values a component gets as ``factor * value + offset``."""
        first = self._descriptions[target[0]].info[target[1]]
        low, high = first.low, first.high
        if (factor, offset) != _UNCHANGED:
            if first.kind != "real":
                raise self._wrong(f"{_title(target)}: only reals can be converted; remove factor and offset")
            limits = [None if x is None else float(f"{(x - offset) / factor:.15g}") for x in (low, high)]
            low, high = limits if factor > 0 else limits[::-1]
        start = (float(first.start) - offset) / factor if isinstance(first.start, int | float) else 0.0
        unit = self._connectors.get(end, ("", ""))[1] or first.unit
        return replace(first, name=_title(end), unit=unit, low=low, high=high, start=start, alias_of="")

    def _targets(self, name: str) -> Iterator[tuple[End, End, tuple[float, float]]]:
        """Yield the variables of components that a name means, the connector of this name, the conversion."""
        for element in sorted(self.components, key=len, reverse=True):
            local = name.removeprefix(f"{element}.")
            if local != name and local in self._descriptions[element].slots:
                yield (element, local), (element, local), _UNCHANGED
                return
        for end in self._steps:
            if end[0] in self.components and self._connectors[end][0] == "parameter":
                source, found = self._traced(end)
                if _title(source) == name:
                    yield end, source, found

    def _value(self, given: Given, variable: Variable) -> float | str:
        """Return a value for a variable, in its unit."""
        value, change = given.value, given.transformation
        if isinstance(value, str) and not given.is_item:
            if variable.kind != "string":
                raise self._wrong(f"{value!r} is a text, but {variable.name!r} is of type {variable.kind}")
            return value
        if isinstance(value, str):
            if value not in variable.literals:
                near = did_you_mean(value, variable.literals)
                raise self._wrong(f"{variable.name!r} has no item {value!r}; {near}")
            return float(variable.literals[value])
        if variable.kind == "string":
            raise self._wrong(f"{value:g} is a number, but {variable.name!r} is a text")
        if not change.suppress:
            known, is_relative = (self._units, self._units), variable.is_relative
            found = conversion(given.unit, variable.unit, known, is_relative=is_relative)
            if found is None:
                raise self._wrong(
                    f"the parameter {given.name} is in {given.unit}, {variable.name!r} in {variable.unit}, "
                    "and the package defines no conversion; state the variable's unit"
                )
            value = found[0] * value + found[1]
        value = change.factor * value + change.offset
        if wrong := variable.expected(value) or variable.excess(value, value):
            raise self._wrong(f"the parameter {given.name} is {value:g}: {wrong}; correct it")
        return value


def _kind(type_name: str) -> str:
    """Return the kind of the values of a connector; tools write enumerations as integers too."""
    if type_name in ("Real", "Float32", "Float64"):
        return "real"
    return type_name.lower() if type_name in ("Boolean", "String") else "integer"


def _named(at: str) -> str:
    return f"the element {at}" if at else "the system"


def _conversion_text(factor: float, offset: float) -> str:
    """Return what follows a name, as formulas have it: with digits enough to compute with."""
    added = f" {'-' if offset < 0 else '+'} {abs(offset):.15g}" if offset else ""
    return (f" * {factor:.15g}" if factor != 1.0 else "") + added


def _title(end: End) -> str:
    return f"{end[0]}.{end[1]}" if end[0] else end[1]
