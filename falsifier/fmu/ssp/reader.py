"""SSP packages as systems: nested systems are flattened, their names joined by dots.

The meaning of connectors, transformations and parameter bindings is that of SSP 1.0 and 2.0: connections have
no direction of their own, bindings of outer systems override those of inner ones, later ones earlier ones.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from falsifier.core.model import Interface, Variable
from falsifier.errors import ModelError, SpecError, did_you_mean
from falsifier.fmu.description import (
    Description,
    Unit,
    conversion,
    file_hash,
    read_description,
    read_structure,
)
from falsifier.fmu.ssp.markup import Connector, Part, Structure, Transformation, parse_structure
from falsifier.fmu.ssp.package import SUFFIXES, Package
from falsifier.fmu.ssp.parameters import Given, bound_values
from falsifier.fmu.systems import Component, Connection, Coupling, Frame, System

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


@dataclass(frozen=True, slots=True)
class _Step:
    """One connection, in the direction of the signal."""

    source: End
    transformation: Transformation


@dataclass(slots=True)
class _Flat:
    """What the walk through nested systems collects."""

    shown: str
    elements: set[str] = field(default_factory=set)
    fmus: dict[str, Path] = field(default_factory=dict)
    interfaces: dict[str, Interface | None] = field(default_factory=dict)
    descriptions: dict[str, Description] = field(default_factory=dict)
    connectors: dict[End, Connector] = field(default_factory=dict)
    steps: dict[End, _Step] = field(default_factory=dict)
    units: dict[str, Unit] = field(default_factory=dict)
    given: dict[str, Given] = field(default_factory=dict)


def read_package(path: str | Path, *, coupling: Coupling | None = None) -> System:
    """Return the system in an SSP package, or in a system description beside its resources.

    Args:
        path: path of an ``.ssp`` or ``.ssd`` file.
        coupling: how the components exchange values; SSP does not say.

    Raises:
        SpecError: in one line, naming the file and what is wrong with it.
    """
    path = Path(path)
    flat = _Flat(str(path))
    try:
        structure = _walk_file(Package(path, str(path)), "", flat, ())
    except RecursionError:
        raise SpecError(f"{path}: its systems are nested too deeply; flatten them") from None
    _check_times(structure, flat.shown)
    connections: dict[str, Connection | str] = {}
    inputs: dict[End, list[End]] = {}
    notes: list[str] = []
    for end in _component_inputs(flat):
        source, factor, offset = _traced(end, flat)
        if source == end:
            continue
        if not _is_component(source, flat):
            inputs.setdefault(source, []).append(end)
        connections[_title(end)] = Connection(_title(source), factor, offset)
        if (factor, offset) != (1.0, 0.0):
            notes.append(
                f"{_title(source)} -> {_title(end)}: * {factor:.6g} {offset:+.6g}, as the package says"
            )
    variables = tuple(_system_input(end, fed, flat) for end, fed in inputs.items())
    values, unknown = _values(flat, variables, set(connections))
    notes += unknown
    if structure.start_time:
        notes.append(f"the package starts at {structure.start_time:g} s; simulations start at 0")
    frame = Frame(variables, tuple(_outputs(flat)), tuple(values.items()), structure.stop_time, tuple(notes))
    try:
        return System(
            {name: Component(fmu, None, flat.interfaces[name]) for name, fmu in flat.fmus.items()},
            connections,
            coupling=coupling or Coupling(),
            frame=frame,
            name=structure.root.name or path.stem,
            package=path,
        )
    except (SpecError, ModelError) as error:
        raise SpecError(f"{path}: {error}") from None


def _check_times(structure: Structure, shown: str) -> None:
    """Refuse a default experiment that ends before it starts, or before 0, where simulations start."""
    start, stop = structure.start_time or 0.0, structure.stop_time
    if stop is not None and stop <= max(start, 0.0):
        raise SpecError(
            f"{shown}: DefaultExperiment: the stop time {stop:g} s must be after the start time {start:g} s, "
            "and after 0, at which simulations start; correct the package, or leave the stop time out"
        )


def is_package(path: str | Path) -> bool:
    """Whether a path has the name of an SSP package or of a system description."""
    return Path(path).suffix in SUFFIXES


def _walk_file(package: Package, at: str, flat: _Flat, above: tuple[str, ...]) -> Structure:
    if package.key in above:
        raise SpecError(f"{package.shown}: the system contains itself, at {at}; remove one of the references")
    structure = parse_structure(package.structure(), f"{package.shown}: {package.description}")
    flat.units |= structure.units
    _walk(structure.root, at, package, flat, (*above, package.key))
    return structure


def _walk(part: Part, at: str, package: Package, flat: _Flat, above: tuple[str, ...]) -> None:
    own = _declare(part, at, flat)
    inner: dict[str, dict[str, Connector]] = {}
    for child in part.parts:
        path = f"{at}.{child.name}" if at else child.name
        if path in flat.elements:
            raise SpecError(f"{flat.shown}: two elements are named {path!r}; rename one of them")
        flat.elements.add(path)
        if len(flat.elements) > _MAX_ELEMENTS:
            raise SpecError(f"{flat.shown}: the system has more than {_MAX_ELEMENTS} elements; split it")
        inner[child.name] = {c.name: c for c in child.connectors}
        if not child.source:
            _walk(child, path, package, flat, above)
        elif child.type in _NESTED_TYPES:
            _declare(child, path, flat)
            _walk_file(package.nested(child.source), path, flat, above)
            _bind(child, path, package, flat)
        else:
            _component(child, path, package, flat)
    for wire in part.wires:
        _wire(wire.start, wire.end, wire.transformation, at, own, inner, flat)
    _bind(part, at, package, flat)


def _declare(part: Part, at: str, flat: _Flat) -> dict[str, Connector]:
    for connector in part.connectors:
        if connector.kind not in _KINDS:
            known = ", ".join(_KINDS)
            raise SpecError(
                f"{flat.shown}: the connector {_title((at, connector.name))} is of kind {connector.kind!r}; "
                f"expected one of {known}"
            )
        flat.connectors[at, connector.name] = connector
    return {c.name: c for c in part.connectors}


def _component(part: Part, at: str, package: Package, flat: _Flat) -> None:
    if part.type != _FMU_TYPE:
        raise SpecError(f"{flat.shown}: the component {at} is of type {part.type}; only FMUs are supported")
    if part.implementation not in _INTERFACES:
        known = ", ".join(_INTERFACES)
        raise SpecError(
            f"{flat.shown}: the implementation of {at} is {part.implementation!r}; expected one of {known}"
        )
    flat.fmus[at] = package.file(part.source)
    flat.interfaces[at] = _INTERFACES[part.implementation]
    try:
        description = flat.descriptions[at] = read_description(flat.fmus[at])
    except ModelError as error:
        raise SpecError(f"{flat.shown}: {part.source}: {error}") from None
    flat.units = {**read_structure(flat.fmus[at], file_hash(flat.fmus[at])).units, **flat.units}
    variables = {v.name: v for v in description.info.variables}
    for connector in part.connectors:
        _check_connector(connector, variables.get(connector.name), at, variables, flat)
    _declare(part, at, flat)
    _bind(part, at, package, flat)


def _check_connector(
    connector: Connector, variable: Variable | None, at: str, known: dict[str, Variable], flat: _Flat
) -> None:
    title = _title((at, connector.name))
    if variable is None:
        near = did_you_mean(connector.name, known)
        raise SpecError(f"{flat.shown}: the FMU of {at} has no variable for the connector {title}; {near}")
    if variable.causality != connector.kind:
        raise SpecError(
            f"{flat.shown}: the connector {title} is of kind {connector.kind}, but the FMU's variable has "
            f"the causality {variable.causality}; use the FMU's"
        )
    if connector.type and _kind(connector.type) != (
        "integer" if variable.kind == "enumeration" else variable.kind
    ):
        raise SpecError(
            f"{flat.shown}: the connector {title} is of type {connector.type}, but the FMU's variable of "
            f"type {variable.type or variable.kind}; state the FMU's type"
        )
    if connector.unit and variable.unit and connector.unit != variable.unit:
        raise SpecError(
            f"{flat.shown}: the connector {title} is in {connector.unit}, but the FMU's variable in "
            f"{variable.unit}; state the FMU's unit"
        )


def _kind(type_name: str) -> str:
    """Return the kind of the values of a connector; tools write enumerations as integers too."""
    if type_name in ("Real", "Float32", "Float64"):
        return "real"
    return type_name.lower() if type_name in ("Boolean", "String") else "integer"


def _wire(
    start: tuple[str | None, str],
    end: tuple[str | None, str],
    transformation: Transformation,
    at: str,
    own: dict[str, Connector],
    inner: dict[str, dict[str, Connector]],
    flat: _Flat,
) -> None:
    """Note which end of a connection feeds the other; inside its system, an input connector is a source."""
    text = f"{_shown(start)} - {_shown(end)}"
    sources: list[End] = []
    sinks: list[End] = []
    for element, name in (start, end):
        of = own if element is None else inner.get(element)
        if of is None or name not in of:
            near = did_you_mean(element or name, inner) if of is None else did_you_mean(name, of)
            what = f"element {element!r}" if of is None else f"connector {_shown((element, name))!r}"
            raise SpecError(f"{flat.shown}: the connection {text} names the unknown {what}; {near}")
        is_source = of[name].kind in (_SINKS if element is None else _SOURCES)
        path = at if element is None else f"{at}.{element}" if at else element
        (sources if is_source else sinks).append((path, name))
    if len(sources) != 1:
        both = "outputs" if sources else "inputs"
        raise SpecError(
            f"{flat.shown}: the connection {text} joins two {both}; connect an output to an input"
        )
    if flat.connectors[sources[0]].kind == "calculatedParameter":
        raise SpecError(
            f"{flat.shown}: the connection {text} passes on a calculated parameter, which is not supported; "
            "set the parameter in a parameter set"
        )
    known = flat.steps.get(sinks[0])
    if known is not None:
        raise SpecError(
            f"{flat.shown}: {_title(sinks[0])} is fed by {_title(known.source)} and by {_title(sources[0])}; "
            "remove one of the connections"
        )
    flat.steps[sinks[0]] = _Step(sources[0], transformation)


def _shown(end: tuple[str | None, str]) -> str:
    return f"{end[0]}.{end[1]}" if end[0] else end[1]


def _bind(part: Part, at: str, package: Package, flat: _Flat) -> None:
    """Add the values of an element's bindings; it is called from the inside out, so that outer ones win."""
    for name, value in bound_values(part.bindings, package, flat.units).items():
        flat.given[f"{at}.{name}" if at else name] = value


def _component_inputs(flat: _Flat) -> Iterator[End]:
    for end, connector in flat.connectors.items():
        if connector.kind == "input" and _is_component(end, flat):
            yield end


def _is_component(end: End, flat: _Flat) -> bool:
    return end[0] in flat.fmus


def _traced(end: End, flat: _Flat) -> tuple[End, float, float]:
    """Follow the connections back from a connector; return where they begin, and the conversion."""
    chain: list[tuple[End, _Step]] = []
    at = end
    while (step := flat.steps.get(at)) is not None:
        chain.append((at, step))
        at = step.source
        if any(at == passed for passed, _ in chain):
            circle = " -> ".join(_title(passed) for passed, _ in chain)
            raise SpecError(f"{flat.shown}: connectors feed each other in a circle: {circle}; remove one")
    factor, offset, unit = 1.0, 0.0, _unit(at, flat)
    for target, step in reversed(chain):
        wanted, transformation = _unit(target, flat), step.transformation
        if not transformation.suppress:
            found = conversion(unit, wanted, (flat.units, flat.units))
            if found is None:
                raise SpecError(
                    f"{flat.shown}: {_title(step.source)} is in {unit}, {_title(target)} in {wanted}; the "
                    "package defines no conversion; define both units, or suppress the conversion"
                )
            factor, offset = found[0] * factor, found[0] * offset + found[1]
        factor = transformation.factor * factor
        offset = transformation.factor * offset + transformation.offset
        unit = wanted or unit
    return at, factor, offset


def _unit(end: End, flat: _Flat) -> str:
    connector = flat.connectors[end]
    if connector.unit or not _is_component(end, flat):
        return connector.unit
    return flat.descriptions[end[0]].info[end[1]].unit


def _system_input(end: End, fed: list[End], flat: _Flat) -> Variable:
    """Return an input of the whole: as its first target, with the connector's own unit."""
    first = flat.descriptions[fed[0][0]].info[fed[0][1]]
    _, factor, offset = _traced(fed[0], flat)
    limits = [None if x is None else (x - offset) / factor for x in (first.low, first.high)]
    low, high = limits if factor > 0 else limits[::-1]
    start = (float(first.start) - offset) / factor if isinstance(first.start, int | float) else 0.0
    unit = _unit(end, flat) or first.unit
    return replace(first, name=_title(end), unit=unit, low=low, high=high, start=start, alias_of="")


def _outputs(flat: _Flat) -> Iterator[tuple[str, str]]:
    """Yield the outputs of the whole that pass an output of a component unchanged, with its name."""
    for end, connector in flat.connectors.items():
        if end[0] == "" and connector.kind == "output":
            source, factor, offset = _traced(end, flat)
            if (factor, offset) == (1.0, 0.0) and _is_component(source, flat):
                yield end[1], _title(source)


def _values(
    flat: _Flat, inputs: tuple[Variable, ...], connected: set[str]
) -> tuple[dict[str, float | str], list[str]]:
    """Return the values of variables, and notes on those that name nothing."""
    found: dict[str, float | str] = {}
    notes: list[str] = []
    own = {v.name: v for v in inputs}
    for name, given in flat.given.items():
        targets = list(_targets(name, flat))
        if name in own:
            found[name] = given.number(own[name], flat.shown)
        for element, local in targets:
            title, description = _title((element, local)), flat.descriptions[element]
            if title in connected:
                continue
            slot = description.slots[local]
            if slot.refusal:
                raise SpecError(f"{flat.shown}: the parameter {title} cannot be set: {slot.refusal}")
            found[title] = given.number(description.info[local], flat.shown)
        if not targets and name not in own:
            notes.append(f"the parameter {name} of the package names nothing that can be set")
    return found, notes


def _targets(name: str, flat: _Flat) -> Iterator[End]:
    """Yield the variables that a name means: one of a component, or what a parameter connector feeds."""
    for element in sorted(flat.fmus, key=len, reverse=True):
        if name.startswith(f"{element}.") and name[len(element) + 1 :] in flat.descriptions[element].slots:
            yield element, name[len(element) + 1 :]
            return
    for end in flat.steps:
        if _is_component(end, flat) and flat.connectors[end].kind == "parameter":
            source, factor, offset = _traced(end, flat)
            if _title(source) == name and (factor, offset) == (1.0, 0.0):
                yield end


def _title(end: End) -> str:
    return f"{end[0]}.{end[1]}" if end[0] else end[1]
