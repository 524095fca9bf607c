"""The tables of a system that the compiled loops of coupled_stepping.py work on."""

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from falsifier.fmu import coupled_stepping as loops
from falsifier.fmu.buffers import Room
from falsifier.fmu.instance import FmuInstance
from falsifier.fmu.plan import Plan
from falsifier.fmu.ports import Ports, make_ports
from falsifier.fmu.process.encoding import fixed_elements
from falsifier.fmu.saved_state import SavedState
from falsifier.fmu.stepper import check_range, is_held, write_fixed
from falsifier.fmu.systems.network import SYSTEM, Link, Member, Network, Place

if TYPE_CHECKING:
    from falsifier.fmu.system_solver import SystemSolver

_FUNCTIONS = ("DoStep", "EnterEventMode", "UpdateDiscreteStates", "EnterStepMode")


class SystemTables:
    """Component, feed and signal rows of a system; see coupled_stepping.py.

    Args:
        network: the system.
        parts: its components, loaded, in the order of the network's members.
        plan: what the simulations have in common.
        room: arrays of inputs and outputs.

    Attributes:
        components: one row per component, in the order in which they step.
        signals: one row per connected output.
        titles: names of the connected outputs in the system, in the order of their rows.
        members: positions of the components that have these outputs.
        copies: connected outputs to record, and the addresses of the rows to record them to.

    Raises:
        ModelError: if a library lacks functions for the variables.
    """

    def __init__(self, network: Network, parts: Sequence[FmuInstance], plan: Plan, room: Room) -> None:
        self._network, self._parts, self._plan, self._room = network, parts, plan, room
        self._memory: list[object] = []
        self._fixed: list[tuple[Ports, list[int]]] = []
        self._checked: list[tuple[str, list[str], Ports, list[int]]] = []
        sources = sorted(
            {
                (network.order.index(n.source.member), n.source.member, n.source.name)
                for n in network.links
                if n.source.member != SYSTEM
            }
        )
        self._signal_of = {Place(member, name): k for k, (_, member, name) in enumerate(sources)}
        self.titles = [network.title(place) for place in self._signal_of]
        self.members = [place.member for place in self._signal_of]
        self.signals = np.zeros((len(sources), loops.SIGNAL_WIDTH))
        self._links = {n.target: n for n in network.links}
        self._inputs = {network.places[name]: row for row, name in enumerate(plan.inputs)}
        self._constants = _Constants(network, plan, room)
        targets = [*self._links, *self._inputs]
        self._feeds = np.zeros((len(targets), loops.FEED_WIDTH), dtype=np.int64)
        self._solvers: dict[int, tuple[SystemSolver, NDArray[np.int64], list[Place]]] = {}
        self._fed = 0
        self.components = np.zeros((len(parts), loops.COMPONENT_WIDTH), dtype=np.int64)
        recorded = [(network.places[name], row) for row, name in enumerate(plan.outputs)]
        self.copies = np.array(
            [
                (self._address_of_signal(self._signal_of[place]), self._address_of_row(row))
                for place, row in recorded
                if place in self._signal_of
            ],
            dtype=np.int64,
        ).reshape(-1, 2)
        for position, member in enumerate(network.order):
            self._fill(self.components[position], member, recorded)
        self._first_feeds = self._feeds.copy()
        self._states = [self._iterate(first, last) for first, last in network.loops]

    def start_again(self) -> None:
        """Forget the last simulation: no output is known, all inputs are in their first piece.

        The instances may be others than those of the last simulation.

        Raises:
            SimulationError: if an input does not fit its type.
        """
        for row, member in zip(self.components, self._network.order, strict=True):
            row[loops.FUNCTIONS] = self._parts[member].library.component
            row[loops.CHANGED] = 0
        self._feeds[:] = self._first_feeds
        self._constants.fill()
        self.signals[:, loops.TIME] = self.signals[:, loops.OLD_TIME] = -1.0
        for name, names, ports, rows in self._checked:
            pieces = self._room.inputs[rows].reshape(len(rows), self._plan.pieces, 5)
            # Interpolated values are always between those at the ends of a piece.
            values = np.where(np.isfinite(pieces[:, :, 0]), pieces[:, :, 1], pieces[:, :1, 1])
            check_range(name, names, ports, values)
        for ports, rows in self._fixed:
            write_fixed(ports, self._room.parameters[rows])
        for solver, _, places in self._solvers.values():
            solver.start_again([self._pieces_of(place) for place in places])

    def forget(self) -> None:
        """Free the states that iterated components have saved."""
        for states in self._states:
            for state in states:
                state.forget()

    def _iterate(self, first: int, last: int) -> list[SavedState]:
        """Let the components at these positions iterate."""
        states = []
        self.components[first, loops.LOOP_END] = last
        for row, member in zip(self.components[first:last], self._network.order[first:last], strict=True):
            state = SavedState(self._parts[member].library)
            row[loops.GET_STATE : loops.STATE + 1] = state.addresses
            kept = np.zeros_like(self._feeds)
            self._memory.append(kept)
            row[loops.KEPT_FEEDS] = kept.ctypes.data
            states.append(state)
        return states

    def begin(self, member: int) -> None:
        """Get a component from initialisation to its first step; only model exchange needs that.

        Raises:
            SimulationError: if an event at time 0 fails.
        """
        if member in self._solvers:
            solver, feeds, _ = self._solvers[member]
            written = feeds.view(np.float64)[:, loops.WRITTEN].tolist()
            is_connected = feeds[:, loops.IS_SIGNAL].tolist()
            solver.begin([value if fed else None for value, fed in zip(written, is_connected, strict=True)])

    def _pieces_of(self, place: Place) -> tuple[NDArray[np.float64], float, float] | None:
        """Return the pieces of a driven input, with factor and offset; None if an output feeds it."""
        link = self._links.get(place)
        source = place if link is None else link.source
        if link is not None and link.source.member != SYSTEM:
            return None
        if source in self._inputs:
            pieces = self._room.inputs[self._inputs[source]].reshape(-1, 5)
        else:
            pieces = self._constants.pieces(source.name)
        return (pieces, 1.0, 0.0) if link is None else (pieces, link.factor, link.offset)

    def _fill(self, row: NDArray[np.int64], member: int, recorded: Sequence[tuple[Place, int]]) -> None:
        part, one = self._parts[member], self._network.members[member]
        library = part.library
        row[loops.FUNCTIONS : loops.PLAIN] = [
            0,  # the instance, see start_again
            *(library.address(name) for name in _FUNCTIONS),
            one.description.major,
            int(steps_with_events(one)),
        ]
        kinds = {v.name: v for v in one.description.info.variables}
        places = [p for p in (*self._links, *self._inputs) if p.member == member]
        held = [p for p in places if is_held(one.description, one.interface, kinds[p.name])]
        plain = [p for p in places if p not in held]
        first = self._fed
        ports = self._inputs_to(row, loops.PLAIN, loops.PLAIN_FEEDS, plain, one, library.setters())
        held_ports = self._inputs_to(row, loops.HELD, loops.HELD_FEEDS, held, one, library.setters())
        if one.interface == "model-exchange":
            self._solve(row, member, (ports, held_ports), [*plain, *held], first)
        signals = {place: k for place, k in self._signal_of.items() if place.member == member}
        self._ports_to(row, loops.SOURCES, one, signals, library.getters())
        row[loops.SIGNALS] = self._address_of_signal(min(signals.values(), default=0))
        others = [(p, k) for p, k in recorded if p.member == member and p not in signals]
        self._ports_to(row, loops.RECORDED, one, [p for p, _ in others], library.getters())
        rows = np.array([self._address_of_row(k) for _, k in others], dtype=np.int64)
        self._memory.append(rows)
        row[loops.ROWS] = rows.ctypes.data
        step = self._plan.stop_time / self._plan.steps
        row[loops.EVERY] = 1 if one.step is None else round(one.step / step)

    def _solve(
        self,
        row: NDArray[np.int64],
        member: int,
        ports: tuple[Ports, Ports],
        places: list[Place],
        first: int,
    ) -> None:
        # The solver takes seconds to load and is not needed for co-simulation.
        from falsifier.fmu.system_solver import SystemSolver

        solver = SystemSolver(self._network.members[member], self._parts[member], self._plan, ports)
        feeds = self._feeds[first : first + len(places)]
        feeds[:, loops.LINE] = solver.lines.ctypes.data + solver.lines.strides[0] * np.arange(len(places))
        row[loops.INTEGRATE], row[loops.SOLVER] = solver.address, solver.row.ctypes.data
        self._solvers[member] = (solver, feeds, places)

    def _inputs_to(
        self,
        row: NDArray[np.int64],
        ports_column: int,
        feeds_column: int,
        places: Sequence[Place],
        member: Member,
        setters: dict[str, int],
    ) -> Ports:
        ports = self._ports_to(row, ports_column, member, places, setters, self._parameters_of(member))
        row[feeds_column] = self._feeds.ctypes.data + self._fed * self._feeds.itemsize * loops.FEED_WIDTH
        for place in places:
            self._feed(self._feeds[self._fed], place)
            self._fed += 1
        driven = {p: self._inputs.get(self._links[p].source if p in self._links else p) for p in places}
        rows = {place: k for place, k in driven.items() if k is not None}
        if ports.is_limited and rows:
            names = [place.name for place in rows]
            part = make_ports(member.description, names, setters)
            self._checked.append((member.name, names, part, list(rows.values())))
        return ports

    def _feed(self, feed: NDArray[np.int64], place: Place) -> None:
        numbers = feed.view(np.float64)
        numbers[loops.WRITTEN] = np.nan
        link: Link | None = self._links.get(place)
        numbers[loops.FACTOR] = 1.0 if link is None else link.factor
        numbers[loops.OFFSET] = 0.0 if link is None else link.offset
        source = place if link is None else link.source
        if source in self._inputs:
            inputs = self._room.inputs
            feed[loops.SOURCE] = inputs.ctypes.data + self._inputs[source] * inputs.strides[0]
        if link is None:
            return
        if link.source.member == SYSTEM:
            if source not in self._inputs:
                feed[loops.SOURCE] = self._constants.address(source.name)
            return
        feed[loops.SOURCE] = self._address_of_signal(self._signal_of[link.source])
        feed[loops.IS_SIGNAL], feed[loops.LINEAR] = 1, int(link.is_linear)
        numbers[loops.START] = link.start

    def _ports_to(
        self,
        row: NDArray[np.int64],
        column: int,
        member: Member,
        places: Iterable[Place],
        addresses: dict[str, int],
        parameters: Mapping[str, int] = MappingProxyType({}),
    ) -> Ports:
        names = [place.name for place in places]
        known = list(parameters)
        fixed = [known[k] for k in fixed_elements(member.description, names, known)]
        ports = make_ports(member.description, names, addresses, fixed)
        if fixed:
            self._fixed.append((ports, [parameters[name] for name in fixed]))
        self._memory.append(ports)
        row[column : column + 4] = ports.table
        return ports

    def _parameters_of(self, member: Member) -> dict[str, int]:
        """Return the positions in the plan of a component's parameters, by their names in the component."""
        places = ((self._network.places[name], k) for k, name in enumerate(self._plan.parameters))
        members = self._network.members
        return {p.name: k for p, k in places if p.member != SYSTEM and members[p.member] is member}

    def _address_of_signal(self, k: int) -> int:
        return int(self.signals.ctypes.data) + k * self.signals.itemsize * loops.SIGNAL_WIDTH

    def _address_of_row(self, row: int) -> int:
        return int(self._room.outputs.ctypes.data) + row * self._room.outputs.strides[0]


class _Constants:
    """Inputs of the system that no signal drives: one piece each, the value of a parameter or the start."""

    def __init__(self, network: Network, plan: Plan, room: Room) -> None:
        self._names = [name for name, place in network.places.items() if place.member == SYSTEM]
        starts = {v.name: v.start for v in network.description.info.variables}
        self._starts = [float(starts[name] or 0.0) for name in self._names]
        self._rows = [plan.parameters.index(n) if n in plan.parameters else None for n in self._names]
        self._room = room
        self._pieces = np.zeros((len(self._names), plan.pieces, 5))
        self._pieces[:, 1:, 0] = np.inf

    def address(self, name: str) -> int:
        return int(self._pieces.ctypes.data) + self._names.index(name) * self._pieces.strides[0]

    def pieces(self, name: str) -> NDArray[np.float64]:
        found: NDArray[np.float64] = self._pieces[self._names.index(name)]
        return found

    def fill(self) -> None:
        for k, row in enumerate(self._rows):
            self._pieces[k, 0, 1] = self._starts[k] if row is None else self._room.parameters[row]


def steps_with_events(member: Member) -> bool:
    """Whether a component of co-simulation has an event mode, in which its discrete inputs change."""
    description = member.description
    return member.interface == "co-simulation" and description.major == 3 and description.event_mode
