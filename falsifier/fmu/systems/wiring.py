"""Checking the components and connections of a system, before anything is simulated."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from falsifier.core.arguments import finite, one_of
from falsifier.core.model import Interface, Variable
from falsifier.errors import SpecError, did_you_mean
from falsifier.fmu.description import Structure, conversion, describe, read_structure
from falsifier.fmu.systems.network import (
    SYSTEM,
    Coupling,
    Extrapolation,
    Frame,
    Link,
    Member,
    Network,
    Place,
    merged,
)
from falsifier.fmu.systems.step_order import Dependencies, direct_loop, iterated_order, late_links, step_order

_EXTRAPOLATIONS = ("hold", "linear")


@dataclass(frozen=True, slots=True)
class Connection:
    """Where the values of an input come from.

    Attributes:
        source: the output, as ``component.variable``.
        factor: factor of a conversion ``factor * value + offset``; with it, or with an offset, units are not
            converted.
        offset: offset of the conversion.
        extrapolation: ``hold`` or ``linear``; None: that of the system.
    """

    source: str
    factor: float | None = None
    offset: float | None = None
    extrapolation: Extrapolation | None = None


def make_network(
    name: str,
    components: Mapping[str, tuple[Path, str, float | None, Interface | None]],
    connections: Mapping[str, Connection],
    coupling: Coupling,
    frame: Frame,
) -> Network:
    """Check a system and return it with all names resolved.

    Args:
        name: name of the system.
        components: path and hash of the FMU, a step of its own in s, and the interface, by component.
        connections: where the values of inputs come from, by input, as ``component.variable``.
        coupling: how the components exchange values.
        frame: what the system has as a whole.

    Raises:
        ModelError: if an FMU cannot be read.
        SpecError: naming both ends of a connection that does not fit, and the remedy.
    """
    members = tuple(_member(k, each, *components[each]) for k, each in enumerate(components))
    structures = [read_structure(m.path, m.sha256) for m in members]
    joiner = _Joiner(members, structures, coupling, frame)
    for target, connection in connections.items():
        joiner.connect(target, connection)
    links = tuple(joiner.links)
    dependencies = Dependencies(members, structures)
    loop = direct_loop(links, dependencies)
    if loop and coupling.loops == "refuse":
        raise SpecError(_loop_text(loop, members), key="connections")
    if coupling.loops == "iterate":
        order, loops = iterated_order(len(members), links, dependencies)
        _check_restorable(members, order, loops)
    else:
        order, loops = step_order(len(members), links, dependencies), ()
    late = links if coupling.method == "jacobi" else tuple(late_links(links, order, loops))
    notes = [*_order_notes(members, order, late), *_loop_notes(members, order, loops), *joiner.notes]
    description, places = merged(name, members, links, frame, notes)
    return Network(name, members, links, order, loops, coupling, description, places)


def _member(
    position: int, name: str, path: Path, sha256: str, step: float | None, interface: Interface | None
) -> Member:
    description = describe(path, sha256)
    key = f"components.{name}"
    offered = description.info.interfaces
    if not offered:
        raise SpecError(
            f"{path}: the FMU offers neither co-simulation nor model exchange; export it for one of them",
            key=key,
        )
    if interface is not None and interface not in offered:
        raise SpecError(
            f"the FMU offers {' and '.join(offered)}, not {interface}; change or remove this key",
            key=f"{key}.interface",
        )
    chosen = interface or ("co-simulation" if "co-simulation" in offered else offered[0])
    if description.major == 1:
        raise SpecError(
            f"{path}: an FMU of FMI 1 has no initialisation mode, in which connected components find their "
            "first values; export it as FMI 2 or 3",
            key=key,
        )
    if description.needs_wine("co-simulation"):
        raise SpecError(
            f"{path}: its only library is for Windows; such an FMU runs through Wine, but not as a component "
            "of a system; export it for this platform too",
            key=key,
        )
    named = replace(description, info=replace(description.info, name=name))
    return Member(name, path, sha256, named, step, chosen, str(position))


class _Joiner:
    """Resolves connections one by one and collects their links."""

    def __init__(
        self,
        members: tuple[Member, ...],
        structures: list[Structure],
        coupling: Coupling,
        frame: Frame,
    ) -> None:
        self._inputs = {v.name: v for v in frame.inputs}
        self._members, self._structures, self._coupling = members, structures, coupling
        self._sources: dict[tuple[int, int, int], str] = {}
        self.links: list[Link] = []
        self.notes: list[str] = []

    def connect(self, target: str, connection: Connection) -> None:
        """Add the links of one connection: one, or one per element of an array."""
        title = f"{connection.source} -> {target}"
        sources = self._scalars(connection.source, "output", title)
        targets = self._scalars(target, "input", title)
        if len(sources) != len(targets):
            raise _misfit(
                title,
                f"{connection.source} has {len(sources)} elements, {target} has {len(targets)}; connect "
                "arrays of equal size, or single elements such as NAME[1]",
            )
        for source, end in zip(sources, targets, strict=True):
            self._link(source, end, connection, title)

    def _scalars(self, name: str, role: str, title: str) -> list[Place]:
        """Return the variable of this name; of an array, its elements."""
        if role == "output" and name in self._inputs:
            return [Place(SYSTEM, name)]
        member, local = self._owner(name, title)
        description = self._members[member].description
        if local in description.slots:
            found = [local]
        else:
            found = [
                n for n, s in description.slots.items() if s.declared == local and n.startswith(f"{local}[")
            ]
        if not found:
            of_role = [v.name for v in description.info.variables if v.causality == role]
            raise _misfit(
                title,
                f"{self._members[member].name} has no {role} {local!r}; {did_you_mean(local, of_role)}",
            )
        variable = description.info[found[0]]
        if variable.causality != role:
            of_role = [v.name for v in description.info.variables if v.causality == role]
            raise _misfit(
                title,
                f"{name} is not an {role}, its causality is {variable.causality}; the {role}s of "
                f"{self._members[member].name} are: {', '.join(of_role) or 'none'}",
            )
        return [Place(member, each) for each in found]

    def _owner(self, name: str, title: str) -> tuple[int, str]:
        """Split a name into component and variable; both may contain dots."""
        owners = [k for k, m in enumerate(self._members) if name.startswith(f"{m.name}.")]
        if not owners:
            raise _misfit(
                title,
                f"no component of the name in {name!r}, which is written as COMPONENT.VARIABLE; "
                f"{did_you_mean(name.partition('.')[0], (m.name for m in self._members))}",
            )
        longest = max(owners, key=lambda k: len(self._members[k].name))
        return longest, name[len(self._members[longest].name) + 1 :]

    def _variable(self, place: Place) -> Variable:
        if place.member == SYSTEM:
            return self._inputs[place.name]
        return self._members[place.member].description.info[place.name]

    def _link(self, source: Place, target: Place, connection: Connection, title: str) -> None:
        a, b = self._variable(source), self._variable(target)
        slot = self._members[target.member].description.slots[target.name]
        known = self._sources.setdefault((target.member, slot.reference, slot.offset), title)
        if known != title:
            raise _misfit(title, f"this input is already connected: {known}; remove one of the two")
        _check_types(a, b, title)
        factor, offset = self._conversion(source, target, connection, title)
        if (factor, offset) != (1.0, 0.0) and b.kind != "real":
            raise _misfit(title, f"values of type {b.kind} cannot be converted; remove factor and offset")
        extrapolation = connection.extrapolation or self._coupling.extrapolation
        one_of(f"{title}: extrapolation", extrapolation, _EXTRAPOLATIONS)
        if connection.extrapolation == "linear" and not b.is_continuous:
            raise _misfit(title, 'only continuous real inputs follow a line; use extrapolation = "hold"')
        start = float(b.start) if isinstance(b.start, int | float) else 0.0
        self.links.append(
            Link(source, target, factor, offset, start, extrapolation == "linear" and b.is_continuous)
        )

    def _conversion(
        self, source: Place, target: Place, connection: Connection, title: str
    ) -> tuple[float, float]:
        if connection.factor is not None or connection.offset is not None:
            factor = 1.0 if connection.factor is None else finite(f"{title}: factor", connection.factor)
            if factor == 0.0:
                raise _misfit(
                    title, "factor = 0 passes nothing on; state another, or remove it and fix the input"
                )
            return factor, finite(f"{title}: offset", connection.offset or 0.0)
        a, b = self._variable(source), self._variable(target)
        units = self._structures[target.member].units
        known = (units if source.member == SYSTEM else self._structures[source.member].units, units)
        found = conversion(a.unit, b.unit, known)
        if found is None:
            raise _misfit(
                title,
                f"the output is in {a.unit}, the input in {b.unit}, and neither FMU defines how to convert "
                f"one to the other; connect like units, or state the conversion: "
                f'{{ from = "{connection.source}", factor = NUMBER, offset = NUMBER }}',
            )
        if found != (1.0, 0.0):
            shown = f" {found[1]:+.6g}" if found[1] else ""
            self.notes.append(f"{title}: converted from {a.unit} to {b.unit}: * {found[0]:.6g}{shown}")
        elif a.unit != b.unit and not (a.unit and b.unit):
            silent, other = (
                ("input", f"output is in {a.unit}") if a.unit else ("output", f"input is in {b.unit}")
            )
            self.notes.append(f"{title}: passes unchanged; the {silent} states no unit, the {other}")
        return found


def _check_types(a: Variable, b: Variable, title: str) -> None:
    if "string" in (a.kind, b.kind):
        raise _misfit(title, "strings cannot be connected; connect numbers")
    for variable in (a, b):
        if variable.is_clocked:
            raise _misfit(title, f"{variable.name!r} belongs to a clock, which no system ticks")
    if a.kind != b.kind and not (a.kind == "integer" and b.kind == "real"):
        raise _misfit(
            title,
            f"the output is of type {a.kind}, the input of type {b.kind}; export one of them with the type "
            "of the other",
        )
    if a.literals and b.literals and dict(a.literals) != dict(b.literals):
        raise _misfit(
            title, f"the enumerations differ: {_items(a)} and {_items(b)}; export both with the same"
        )
    limits, fits = a.limits, b.type_limits
    if a.kind == "integer" and fits is not None and a.type_limits is not None:
        low = a.type_limits[0] if limits[0] is None else limits[0]
        high = a.type_limits[1] if limits[1] is None else limits[1]
        if low < fits[0] or high > fits[1]:
            raise _misfit(
                title,
                f"values from {low:g} to {high:g} do not fit the input, whose type {b.type} ranges from "
                f"{fits[0]} to {fits[1]}; state min and max of the output, or export the input with a larger "
                "type",
            )


def _items(variable: Variable) -> str:
    return ", ".join(f"{number} = {name}" for name, number in variable.literals.items())


def _misfit(title: str, what: str) -> SpecError:
    return SpecError(f"{title}: {what}", key="connections")


def _loop_text(loop: list[Place], members: tuple[Member, ...]) -> str:
    names = [f"{members[p.member].name}.{p.name}" for p in loop]
    return (
        f"{' -> '.join([*names, names[0]])}: these depend directly on each other (an algebraic loop), as "
        "their FMUs declare; export one of the components without the direct dependency, for example with a "
        'delay, or accept a delay of one communication step: [coupling] loops = "delay"; or repeat their '
        'steps until they agree: loops = "iterate"'
    )


def _check_restorable(
    members: tuple[Member, ...], order: tuple[int, ...], loops: tuple[tuple[int, int], ...]
) -> None:
    for first, last in loops:
        inside = [members[m] for m in order[first:last]]
        fixed = [m.name for m in inside if m.interface not in m.description.saves_state]
        if fixed:
            raise SpecError(
                f'loops = "iterate" repeats the steps of {", ".join(m.name for m in inside)}, but '
                f"{', '.join(fixed)} cannot restore its state (canGetAndSetFMUState); export it with this "
                'capability, or accept a delay of one communication step: loops = "delay"',
                key="coupling.loops",
            )


def _loop_notes(
    members: tuple[Member, ...], order: tuple[int, ...], loops: tuple[tuple[int, int], ...]
) -> Iterator[str]:
    for first, last in loops:
        names = ", ".join(members[m].name for m in order[first:last])
        verb = "repeats its" if last - first == 1 else "repeat their"
        yield f"{names} {verb} steps until the outputs no longer change"


def _order_notes(
    members: tuple[Member, ...], order: tuple[int, ...], late: tuple[Link, ...]
) -> Iterator[str]:
    names = ", ".join(members[m].name for m in order)
    targets = list(dict.fromkeys(f"{members[n.target.member].name}.{n.target.name}" for n in late))
    text = f"components step in the order {names}"
    if targets:
        use = "uses" if len(targets) == 1 else "use"
        text += f"; {_few(targets)} {use} the values of the previous communication point"
    yield text


def _few(names: list[str], most: int = 10) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
