"""Components and connections of a system: what feeds what, and the order of stepping."""

from collections.abc import Iterator
from dataclasses import dataclass

from falsifier.core.model import Variable
from falsifier.fmu import System
from falsifier.fmu.systems import SYSTEM, Link, Network, Place, late_links

# Maximum number of inputs, and of outputs, that are shown of a component.
MOST_PORTS = 40


@dataclass(frozen=True, slots=True)
class Wire:
    """A connection: names of both ends in the system, what is done to the value, whether it is late."""

    source: str
    target: str
    conversion: str
    is_late: bool


@dataclass(frozen=True, slots=True)
class Port:
    """An input or output of a component: its name there and in the system, and its unit."""

    name: str
    title: str
    unit: str

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True, slots=True)
class Box:
    """A component: its name, what it is, its ports, and how many of them are not shown."""

    name: str
    kind: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    left_out: int


@dataclass(frozen=True, slots=True)
class Diagram:
    """A system as boxes and wires.

    Attributes:
        name: name of the system.
        boxes: components in the order in which they step.
        wires: connections.
        loops: first position in this order, and the one after the last, of components that iterate together.
        outer: names of the inputs of the system as a whole.
        method: how values are exchanged.
    """

    name: str
    boxes: tuple[Box, ...]
    wires: tuple[Wire, ...]
    loops: tuple[tuple[int, int], ...]
    outer: tuple[str, ...]
    method: str


def diagram(system: System) -> Diagram:
    """Return the components and connections of a system."""
    network = system.network
    late = set(_late(network))
    outer = tuple(name for name, place in network.places.items() if place.member == SYSTEM)
    wires = tuple(
        Wire(network.title(n.source), network.title(n.target), _conversion(n), n in late)
        for n in network.links
    )
    connected = {end for wire in wires for end in (wire.source, wire.target)}
    boxes = tuple(_box(network, member, connected) for member in network.order)
    return Diagram(system.name, boxes, wires, network.loops, outer, network.coupling.method)


def _late(network: Network) -> Iterator[Link]:
    if network.coupling.method == "jacobi":
        return (n for n in network.links if n.source.member != SYSTEM)
    return late_links(network.links, network.order, network.loops)


def _conversion(link: Link) -> str:
    factor = "" if link.factor == 1.0 else f" * {link.factor:.6g}"
    offset = "" if link.offset == 0.0 else f" {link.offset:+.6g}"
    line = " (extrapolated)" if link.is_linear else ""
    return f"{factor}{offset}{line}"


def _box(network: Network, position: int, connected: set[str]) -> Box:
    member = network.members[position]
    info = member.description.info
    step = "" if member.step is None else f", every {member.step:.6g} s"

    def ports(variables: tuple[Variable, ...]) -> list[Port]:
        found = [
            Port(v.name, network.title(Place(position, v.name)), v.unit) for v in variables if not v.alias_of
        ]
        # If some are left out, then those that are not connected.
        return sorted(found, key=lambda p: p.title not in connected) if len(found) > MOST_PORTS else found

    inputs, outputs = ports(info.inputs), ports(info.outputs)
    return Box(
        member.name,
        f"{member.path.name}, {member.interface}{step}",
        tuple(inputs[:MOST_PORTS]),
        tuple(outputs[:MOST_PORTS]),
        max(len(inputs) - MOST_PORTS, 0) + max(len(outputs) - MOST_PORTS, 0),
    )


def diagram_text(found: Diagram) -> str:
    """Return a system as text for the terminal: components in the order of stepping, with their ports."""
    return "\n".join(_lines(found))


def loop_texts(found: Diagram) -> Iterator[str]:
    """Yield which components repeat their steps together."""
    for first, last in found.loops:
        yield f"{', '.join(box.name for box in found.boxes[first:last])}: repeated until the outputs agree"


def _lines(found: Diagram) -> Iterator[str]:
    number = len(found.boxes)
    count = f"{number} component" + ("s, in the order in which they step" if number > 1 else "")
    yield f"{found.name}: {count} ({found.method})"
    yield from loop_texts(found)
    feeding = {wire.target: wire for wire in found.wires}
    fed: dict[str, list[str]] = {}
    for wire in found.wires:
        fed.setdefault(wire.source, []).append(wire.target)
    for name in found.outer:
        yield f"   input of the system: {name} -> {', '.join(fed.get(name, ['not connected']))}"
    for k, box in enumerate(found.boxes, start=1):
        yield ""
        yield f"{k:2} {box.name}  ({box.kind})"
        width = max((len(port.label) for port in (*box.inputs, *box.outputs)), default=0)
        for port in box.inputs:
            yield f"     {port.label:{width}}  <-  {_source(feeding.get(port.title))}"
        for port in box.outputs:
            yield f"     {port.label:{width}}  ->  {', '.join(fed.get(port.title, ['not connected']))}"
        if box.left_out:
            yield f"     ... and {box.left_out} more that are not connected"
    if any(wire.is_late for wire in found.wires):
        yield ""
        yield "(late): the value of the previous communication point"


def _source(wire: Wire | None) -> str:
    if wire is None:
        return "not connected"
    return f"{wire.source}{wire.conversion}{'  (late)' if wire.is_late else ''}"
