"""What is simulated, as workers get it: a system of components, or a single FMU, which is a system of one."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar, get_args

from falsifier.core.arguments import one_of, positive, whole
from falsifier.core.model import Interface
from falsifier.errors import SpecError
from falsifier.fmu.description.model_description import Description

T = TypeVar("T")
Method = Literal["gauss-seidel", "jacobi"]
Loops = Literal["refuse", "delay", "iterate"]
Extrapolation = Literal["hold", "linear"]
Isolation = Literal["together", "each"]


@dataclass(frozen=True, slots=True)
class Coupling:
    """How the components of a system exchange values.

    Attributes:
        method: ``gauss-seidel``: components step one after the other, and later ones get the new values of
            earlier ones; ``jacobi``: all step from the values of the same communication point.
        loops: what to do if outputs and inputs depend on each other without a delay: ``refuse`` the system,
            ``delay`` the connection that closes the loop by one communication step, or ``iterate``: repeat
            the steps of the components in the loop until their outputs no longer change.
        extrapolation: value of an input during a step: ``hold`` the last value, or follow the ``linear``
            course through the last two, for continuous real inputs.
        tolerance: change, relative for values above 1, below which initialisation or iteration ends.
        max_rounds: maximum number of rounds of an initialisation, and of an iterated step.
        isolation: ``together``: all components run in one process; ``each``: each in one of its own.

    Raises:
        SpecError: naming the attribute that is not as above.
    """

    method: Method = "gauss-seidel"
    loops: Loops = "refuse"
    extrapolation: Extrapolation = "hold"
    tolerance: float = 1e-9
    max_rounds: int = 100
    isolation: Isolation = "together"

    def __post_init__(self) -> None:
        words = {"method": Method, "loops": Loops, "extrapolation": Extrapolation, "isolation": Isolation}
        for name, kind in words.items():
            one_of(f"coupling.{name}", getattr(self, name), get_args(kind))
        positive("coupling.tolerance", self.tolerance)
        whole("coupling.max_rounds", self.max_rounds, least=2)  # the second one shows that nothing changes
        if self.loops == "iterate" and self.method == "jacobi":
            raise SpecError(
                'coupling.loops: with the method "jacobi" every connection has a delay, and no step is '
                'iterated; use method = "gauss-seidel" or loops = "delay"'
            )


# Position of the system itself in a Place: an input of the whole, which feeds inputs of components.
SYSTEM = -1


@dataclass(frozen=True, slots=True)
class Member:
    """One component."""

    name: str  # its name; empty for a single FMU
    path: Path  # path of its FMU
    sha256: str  # hash of the FMU
    description: Description  # description of the FMU; of a component, with its name in place of the model's
    step: float | None  # step of its own in s; None for the communication step
    interface: Interface  # interface to simulate with


@dataclass(frozen=True, slots=True)
class Place:
    """Where a variable of a system is: position of the component, or SYSTEM, and its name there."""

    member: int
    name: str


@dataclass(frozen=True, slots=True)
class Link:
    """A connection between two scalars: ``target = factor * source + offset``."""

    source: Place  # an output, or an input of the system
    target: Place  # an input
    factor: float  # factor of the conversion
    offset: float  # offset of the conversion
    start: float  # value of the input before the source is known
    is_linear: bool  # whether the input follows the course of the last two values


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """What is simulated: a checked system, or a single FMU as its only component."""

    name: str  # what errors of loading call it: the name of a system, the path of a single FMU
    members: tuple[Member, ...]  # the components
    links: tuple[Link, ...]  # the connections
    order: tuple[int, ...]  # positions of the components in the order in which they step
    # First position in the order, and the one after the last, of components that iterate together.
    loops: tuple[tuple[int, int], ...]
    coupling: Coupling  # how they exchange values
    # Variables of all components, as ``component.variable``; of a single FMU, its own.
    description: Description
    places: Mapping[str, Place]  # where each of these variables is

    def stepped(self, position: int) -> str:
        """Return the name of the component at a position of the order; empty if there is none."""
        return self.members[self.order[position]].name if 0 <= position < len(self.order) else ""

    def of_member(self, member: int, named: Iterable[tuple[str, T]]) -> list[tuple[str, T]]:
        """Return what is of one component among named things, with the names that it has there."""
        places = ((self.places[name], thing) for name, thing in named)
        return [(place.name, thing) for place, thing in places if place.member == member]

    def connected_outputs(self) -> dict[Place, int]:
        """Return the outputs that feed inputs, with their positions among the worker's signals."""
        sources = {link.source for link in self.links if link.source.member != SYSTEM}
        ordered = sorted(sources, key=lambda place: (self.order.index(place.member), place.name))
        return {place: k for k, place in enumerate(ordered)}

    def title(self, place: Place) -> str:
        """Return the name of a variable in the system."""
        return full_name(self.members, place)


def full_name(members: Sequence[Member], place: Place) -> str:
    """Return the name of a variable in a system of these components."""
    return place.name if place.member == SYSTEM else f"{members[place.member].name}.{place.name}"
