"""Checking the components and connections of a system, before anything is simulated."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from falsifier.core.model import Variable
from falsifier.core.words import first_few
from falsifier.errors import SpecError, did_you_mean
from falsifier.fmu.description.model_description import describe
from falsifier.fmu.description.structure import Structure, conversion, read_structure
from falsifier.fmu.process.network import SYSTEM, Coupling, Link, Member, Network, Place, full_name
from falsifier.fmu.systems.components import Component, Connection, Frame, location, merged
from falsifier.fmu.systems.step_order import Dependencies, direct_loop, iterated_order, late_links, step_order


def make_network(
    name: str,
    components: Mapping[str, Component],
    connections: Mapping[str, Connection],
    coupling: Coupling,
    frame: Frame,
) -> Network:
    """Check a system and return it with all names resolved.

    Raises:
        ModelError: if an FMU cannot be read.
        SpecError: naming both ends of a connection that does not fit, and the remedy.
    """
    members = tuple(_member(each, component) for each, component in components.items())
    structures = [read_structure(m.path, m.sha256) for m in members]
    joiner = _Joiner(members, structures, coupling, frame)
    for target, connection in connections.items():
        joiner.connect(target, connection)
    links = tuple(joiner.links)
    dependencies = Dependencies(members, structures)
    loop = direct_loop(links, dependencies)
    if loop and coupling.loops == "refuse":
        shown = " -> ".join(full_name(members, place) for place in (*loop, loop[0]))
        raise SpecError(
            f"{shown}: these depend directly on each other (an algebraic loop), as their FMUs declare; "
            "export one of the components without the direct dependency, for example with a delay, or accept "
            'a delay of one communication step in the coupling: loops = "delay"; or repeat their steps until '
            'they agree: loops = "iterate"',
            key="connections",
        )
    loops: tuple[tuple[int, int], ...] = ()
    if coupling.loops == "iterate":
        order, loops = iterated_order(len(members), links, dependencies)
        for first, last in loops:
            _check_restorable([members[m] for m in order[first:last]])
    else:
        order = step_order(len(members), links, dependencies)
    between = [link for link in links if link.source.member != SYSTEM]
    late = between if coupling.method == "jacobi" else late_links(between, order, loops)
    names = [members[m].name for m in order]
    notes = [_order_note(names, list(dict.fromkeys(full_name(members, link.target) for link in late)))]
    for together in (names[first:last] for first, last in loops):
        verb = "repeats its" if len(together) == 1 else "repeat their"
        notes.append(f"{', '.join(together)} {verb} steps until the outputs no longer change")
    once = Counter(m.sha256 for m in members if m.interface in m.description.once)
    if twice := [m.name for m in members if once[m.sha256] > 1]:
        coupling = replace(coupling, isolation="each")
        notes.append(
            f"each component has a process of its own, because {' and '.join(twice)} are one FMU, which can "
            "be instantiated only once per process, as it declares"
        )
    description, places = merged(name, members, links, frame, [*notes, *joiner.notes])
    return Network(name, members, links, order, loops, coupling, description, places)


def _member(name: str, component: Component) -> Member:
    path, key = component.fmu, f"components.{name}"
    description = describe(path, component.sha256)
    offered = description.info.interfaces
    if not offered:
        raise SpecError(
            f"{path}: the FMU offers neither co-simulation nor model exchange; export it for one of them",
            key=key,
        )
    if component.interface is not None and component.interface not in offered:
        raise SpecError(
            f"the FMU offers {' and '.join(offered)}, not {component.interface}; change or remove this key",
            key=f"{key}.interface",
        )
    if description.major == 1:
        raise SpecError(
            f"{path}: an FMU of FMI 1 has no initialisation mode, in which connected components find their "
            "first values; export it as FMI 2 or 3",
            key=key,
        )
    interface = component.interface or description.info.default_interface
    if description.needs_wine(interface):
        raise SpecError(
            f"{path}: its only library is for Windows; such an FMU runs through Wine, but not as a component "
            "of a system; export it for this platform too",
            key=key,
        )
    named = replace(description, info=replace(description.info, name=name))
    return Member(name, path, component.sha256, named, component.step, interface)


class _Joiner:
    """Resolves connections one by one and collects their links."""

    def __init__(
        self, members: Sequence[Member], structures: Sequence[Structure], coupling: Coupling, frame: Frame
    ) -> None:
        self._inputs = {v.name: v for v in frame.inputs}
        self._members, self._structures, self._coupling = members, structures, coupling
        self._fed: dict[tuple[int, str, int, int], str] = {}
        self.links: list[Link] = []
        self.notes: list[str] = []

    def connect(self, target: str, connection: Connection) -> None:
        """Add the links of one connection: one, or one per element of an array."""
        title = f"{connection.source} -> {target}"
        try:
            sources, targets = self._scalars(connection.source, "output"), self._scalars(target, "input")
            if len(sources) != len(targets):
                raise SpecError(
                    f"{connection.source} has {len(sources)} elements, {target} has {len(targets)}; connect "
                    "arrays of equal size, or single elements such as NAME[1]"
                )
            for source, end in zip(sources, targets, strict=True):
                # Whichever of its names is stated, an input has one source.
                known = self._fed.setdefault(location(self._members, end), title)
                if known != title:
                    raise SpecError(f"this input is already connected: {known}; remove one of the two")
                link, note = self._link(source, end, connection)
                self.links.append(link)
                if note:
                    self.notes.append(f"{title}: {note}")
        except SpecError as error:
            raise SpecError(f"{title}: {error.message}", key="connections") from None

    def _scalars(self, name: str, role: str) -> list[Place]:
        """Return the variable of this name; of an array, its elements."""
        if role == "output" and name in self._inputs:
            return [Place(SYSTEM, name)]
        member, local = self._owner(name)
        component, description = self._members[member].name, self._members[member].description
        slots = description.slots
        elements = (n for n in slots if n.startswith(f"{local}[") and slots[n].declared == local)
        found = [local] if local in slots else list(elements)
        of_role = [v.name for v in description.info.variables if v.causality == role]
        if not found:
            raise SpecError(f"{component} has no {role} {local!r}; {did_you_mean(local, of_role)}")
        causality = description.info[found[0]].causality
        if causality != role:
            raise SpecError(
                f"{name} is not an {role}, its causality is {causality}; the {role}s of {component} are: "
                f"{', '.join(of_role) or 'none'}"
            )
        return [Place(member, each) for each in found]

    def _owner(self, name: str) -> tuple[int, str]:
        """Split a name into component and variable; both may contain dots."""
        owners = [k for k, m in enumerate(self._members) if name.startswith(f"{m.name}.")]
        if not owners:
            near = did_you_mean(name.partition(".")[0], (m.name for m in self._members))
            raise SpecError(
                f"no component of the name in {name!r}, which is written as COMPONENT.VARIABLE; {near}"
            )
        longest = max(owners, key=lambda k: len(self._members[k].name))
        return longest, name[len(self._members[longest].name) + 1 :]

    def _variable(self, place: Place) -> Variable:
        if place.member == SYSTEM:
            return self._inputs[place.name]
        return self._members[place.member].description.info[place.name]

    def _link(self, source: Place, target: Place, connection: Connection) -> tuple[Link, str]:
        """Return the link of two scalars, and what the user should know of its units."""
        a, b = self._variable(source), self._variable(target)
        _check_types(a, b)
        factor, offset, note = self._conversion(source, target, connection)
        if (factor, offset) != (1.0, 0.0) and b.kind != "real":
            raise SpecError(f"values of type {b.kind} cannot be converted; remove factor and offset")
        extrapolation = connection.extrapolation or self._coupling.extrapolation
        if connection.extrapolation == "linear" and not b.is_continuous:
            raise SpecError('only continuous real inputs follow a line; use extrapolation = "hold"')
        start = b.start_number or 0.0
        is_linear = extrapolation == "linear" and b.is_continuous
        return Link(source, target, factor, offset, start, is_linear), note

    def _conversion(self, source: Place, target: Place, connection: Connection) -> tuple[float, float, str]:
        """Return factor and offset, and what is done with units unless the user has stated a conversion."""
        if connection.factor is not None or connection.offset is not None:
            factor = 1.0 if connection.factor is None else connection.factor
            if factor == 0.0:
                raise SpecError("factor = 0 passes nothing on; state another, or remove it and fix the input")
            return factor, connection.offset or 0.0, ""
        output, fed = self._variable(source), self._variable(target)
        a, b = output.unit, fed.unit
        units = self._structures[target.member].units
        known = (units if source.member == SYSTEM else self._structures[source.member].units, units)
        found = conversion(a, b, known, is_relative=output.is_relative or fed.is_relative)
        if found is None:
            raise SpecError(
                f"the output is in {a}, the input in {b}, and neither FMU defines how to convert "
                "one to the other; connect like units, or state factor and offset of this connection"
            )
        if found != (1.0, 0.0):
            shown = f" {found[1]:+.6g}" if found[1] else ""
            return *found, f"converted from {a} to {b}: * {found[0]:.6g}{shown}"
        if bool(a) == bool(b):
            return *found, ""
        silent, other = ("input", f"output is in {a}") if a else ("output", f"input is in {b}")
        return *found, f"passes unchanged; the {silent} states no unit, the {other}"


def _check_types(a: Variable, b: Variable) -> None:
    if "string" in (a.kind, b.kind):
        raise SpecError("strings cannot be connected; connect numbers")
    for variable in (a, b):
        if variable.is_clocked:
            raise SpecError(f"{variable.name!r} belongs to a clock, which no system ticks")
    if a.kind != b.kind and not (a.kind == "integer" and b.kind == "real"):
        raise SpecError(
            f"the output is of type {a.kind}, the input of type {b.kind}; export one of them with the type "
            "of the other"
        )
    if a.literals and b.literals and dict(a.literals) != dict(b.literals):
        raise SpecError(
            f"the enumerations differ: {a.items_text} and {b.items_text}; export both with the same"
        )
    limits, fits = a.limits, b.type_limits
    if a.kind == "integer" and fits is not None and a.type_limits is not None:
        low = a.type_limits[0] if limits[0] is None else limits[0]
        high = a.type_limits[1] if limits[1] is None else limits[1]
        if low < fits[0] or high > fits[1]:
            raise SpecError(
                f"values from {low:g} to {high:g} do not fit the input, whose type {b.type} ranges from "
                f"{fits[0]} to {fits[1]}; state min and max of the output, or export the input with a larger "
                "type"
            )


def _check_restorable(loop: Sequence[Member]) -> None:
    fixed = [m.name for m in loop if m.interface not in m.description.saves_state]
    if fixed:
        raise SpecError(
            f'loops = "iterate" repeats the steps of {", ".join(m.name for m in loop)}, but '
            f"{', '.join(fixed)} cannot restore its state (canGetAndSetFMUState); export it with this "
            'capability, or accept a delay of one communication step: loops = "delay"',
            key="coupling.loops",
        )


def _order_note(names: Sequence[str], late: Sequence[str]) -> str:
    text = f"components step in the order {', '.join(names)}"
    if not late:
        return text
    verb = "uses" if len(late) == 1 else "use"
    return f"{text}; {first_few(late)} {verb} the values of the previous communication point"
