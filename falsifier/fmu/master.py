"""The master of a system: initialises its components across connections and steps them together."""

import time
from collections.abc import Callable, Sequence

import numpy as np

from falsifier.errors import ModelError, SimulationError
from falsifier.fmu import coupled_stepping as loops
from falsifier.fmu import loop_numbers
from falsifier.fmu.buffers import Room
from falsifier.fmu.co_simulation import CHUNK_GROWTH, FIRST_CHUNK, QUICK_SECONDS
from falsifier.fmu.instance import FmuInstance
from falsifier.fmu.library import status_name
from falsifier.fmu.lifecycle import ModalLifecycle
from falsifier.fmu.loops import enter_step_mode, write_row
from falsifier.fmu.plan import Plan
from falsifier.fmu.ports import Ports, make_ports
from falsifier.fmu.stepper import check_range, what_stopped
from falsifier.fmu.system_tables import SystemTables, steps_with_events
from falsifier.fmu.systems.network import Member, Network

# Maximum number of variables that the error of an initialisation that does not converge names.
_SHOWN = 6


class Master:
    """Simulates the components of a system according to a plan, from the inputs in a room to its outputs.

    Args:
        network: the system.
        parts: its components, loaded, in the order of the network's members.
        plan: what the simulations have in common.
        room: arrays of parameters, inputs and outputs.

    Raises:
        ModelError: if a library lacks functions for the plan's variables.
    """

    def __init__(self, network: Network, parts: Sequence[FmuInstance], plan: Plan, room: Room) -> None:
        self._network, self._plan, self._room = network, plan, room
        self._tables = SystemTables(network, parts, plan, room)
        self._steppers = [_Starter(network, m, parts[m], plan, room) for m in network.order]
        self._report = np.zeros(4, dtype=np.int64)
        tables = self._tables
        self._rows = (tables.components.ctypes.data, len(parts))
        self._copies = (tables.copies.ctypes.data, len(tables.copies))
        self._running = room.component.ctypes.data

    def simulate(self, deadline: float) -> None:
        """Simulate once.

        Args:
            deadline: value of ``time.perf_counter()`` at which to give up.

        Raises:
            SimulationError: naming the component that failed, or the outputs that do not converge.
        """
        self._tables.start_again()
        self._each(lambda starter: starter.enter())
        self._find_first_values()
        self._each(lambda starter: starter.leave(self._tables))
        self._record_first()
        self._advance(deadline)
        self._each(lambda starter: starter.terminate())

    def forget(self) -> None:
        """Free what the simulations have saved of the FMUs."""
        self._tables.forget()

    def _each(self, do: "Callable[[_Starter], None]") -> None:
        for position, starter in enumerate(self._steppers):
            self._room.component[0] = position
            do(starter)

    def _find_first_values(self) -> None:
        """Repeat rounds through all components until the connected outputs at time 0 no longer change."""
        coupling, tables, origin = self._network.coupling, self._tables, -1
        for turn in range(coupling.max_rounds):
            moves = loops.start_round(
                *self._rows, self._plan.pieces, coupling.tolerance, self._running, self._report
            )
            self._check(0.0)
            # The first round compares with what the simulation before has left.
            if not moves and (turn or not len(tables.signals)):
                return
            # In the first round with a NaN, the first component that has one did not receive it. It may go
            # again: at first, not all inputs are known.
            missing = int(self._report[loops.COMPONENT])
            origin = missing if origin < 0 or missing < 0 else origin
        if origin >= 0:
            origin = origin if self._not_numbers(origin) else missing
            name, outputs = self._network.stepped(origin), self._not_numbers(origin)
            raise SimulationError(f"{name}: {outputs} is nan at t = 0 s, in the initialisation", time=0.0)
        value = tables.signals[:, loops.VALUE]
        with np.errstate(invalid="ignore"):  # an FMU may return infinite values
            change = np.abs(value - tables.signals[:, loops.TRIED])
        moving = ~(change <= coupling.tolerance * np.maximum(1.0, np.abs(value)))
        raise SimulationError(self._not_converged(np.flatnonzero(moving).tolist(), change.tolist()), time=0.0)

    def _not_converged(self, moving: Sequence[int], change: Sequence[float]) -> str:
        coupling = self._network.coupling
        return (
            f"{self._network.name}: the initialisation does not converge: after {coupling.max_rounds} rounds "
            f"through the connections, these still change: {self._changes(moving, change)}; they depend on "
            "each other in a loop: give a component other start values or a delay, or raise "
            "coupling.max_rounds or coupling.tolerance"
        )

    def _record_first(self) -> None:
        rows, number = self._rows
        for position in range(number):
            self._room.component[0] = position
            address = rows + 8 * loops.COMPONENT_WIDTH * position
            status = loops.read_signals(address, 0.0)
            if status > 1:
                self._fail(position, f"reading the outputs returned {status_name(status)}", 0.0)
            # Otherwise the component that receives it would be blamed.
            if outputs := self._not_numbers(position):
                name = self._network.stepped(position)
                text = f"{name}: {outputs} is nan at t = 0 s, after the initialisation"
                raise SimulationError(text, time=0.0)
        self._report[:] = 0
        if not loops.record(*self._rows, *self._copies, 0, self._report):
            self._check(0.0)

    def _advance(self, deadline: float) -> None:
        plan, report = self._plan, self._report
        stop_time, steps = float(plan.stop_time), plan.steps
        coupling = self._network.coupling
        jacobi = coupling.method == "jacobi"
        # The solver may take long for one communication step.
        is_solved = any(member.interface == "model-exchange" for member in self._network.members)
        first, chunk = 0, 1 if is_solved else FIRST_CHUNK
        while first < steps:
            started = time.perf_counter()
            last = min(first + chunk, steps)
            loops.co_simulate_system(
                *self._rows, jacobi, coupling.tolerance, coupling.max_rounds, plan.pieces, *self._copies,
                stop_time, steps, first, last, plan.every, self._running, report,
            )  # fmt: skip
            reached = int(report[loop_numbers.STEP]) * stop_time / steps
            if report[loop_numbers.STEP] == steps and report[loop_numbers.WHERE] == loop_numbers.TERMINATED:
                return
            self._check(reached)
            self._watch_clock(deadline, reached)
            first = last
            if time.perf_counter() - started < QUICK_SECONDS:
                chunk *= CHUNK_GROWTH

    def _check(self, reached: float) -> None:
        """Raise an error if a loop has reported a failure."""
        status, where, _, position = self._report.tolist()
        if where == loops.NOT_CONVERGED:
            raise SimulationError(self._open_loop(position, reached), time=reached)
        if where == loops.NOT_A_NUMBER:
            self._fail(position, f"{self._not_numbers(position)} became nan", reached)
        if where == loops.RESTORING:
            self._fail(position, f"saving or restoring the state returned {status_name(status)}", reached)
        if where != loop_numbers.DONE:
            self._fail(position, what_stopped(loop_numbers, status, where), reached)

    def _not_numbers(self, position: int) -> str:
        values, member = self._tables.signals[:, loops.VALUE], self._network.order[position]
        own = [k for k in np.flatnonzero(np.isnan(values)).tolist() if self._tables.members[k] == member]
        return ", ".join(self._tables.titles[k] for k in own[:_SHOWN])

    def _open_loop(self, first: int, reached: float) -> str:
        network, signals = self._network, self._tables.signals
        last = next(last for start, last in network.loops if start == first)
        names = {network.members[m].name for m in network.order[first:last]}
        value, change = signals[:, loops.VALUE], np.abs(signals[:, loops.VALUE] - signals[:, loops.TRIED])
        moving = ~(change <= network.coupling.tolerance * np.maximum(1.0, np.abs(value)))
        inside = [
            k for k in np.flatnonzero(moving).tolist() if self._tables.members[k] in network.order[first:last]
        ]
        return (
            f"{network.name}: the loop of {', '.join(sorted(names))} does not converge at t = {reached:g} s: "
            f"after {network.coupling.max_rounds} rounds, these still change: "
            f"{self._changes(inside, change.tolist())}; raise coupling.max_rounds or coupling.tolerance, or "
            'accept a delay of one communication step: loops = "delay"'
        )

    def _changes(self, moving: Sequence[int], change: Sequence[float]) -> str:
        shown = ", ".join(f"{self._tables.titles[k]} (by {change[k]:.3g})" for k in moving[:_SHOWN])
        return shown + (f" and {len(moving) - _SHOWN} more" if len(moving) > _SHOWN else "")

    def _fail(self, position: int, what: str, reached: float) -> None:
        name = self._network.stepped(position)
        raise SimulationError(
            f"{name}: {what} at t = {reached:g} s, before the stop time {self._plan.stop_time:g} s",
            time=reached,
        )

    def _watch_clock(self, deadline: float, reached: float) -> None:
        if time.perf_counter() > deadline:
            raise SimulationError(
                f"{self._network.name}: stopped at t = {reached:g} s after the time limit of "
                f"{self._plan.time_limit:g} s; slow systems need a larger time_limit",
                status="timeout",
                time=reached,
            )


class _Starter:
    """Start and end of one component's simulation."""

    def __init__(self, network: Network, position: int, part: FmuInstance, plan: Plan, room: Room) -> None:
        self._member: Member = network.members[position]
        self._position, self._part, self._plan, self._room = position, part, plan, room
        if not isinstance(part.lifecycle, ModalLifecycle):
            raise ModelError(f"{self._member.name}: components need an initialisation mode")
        self._lifecycle = part.lifecycle
        places = [network.places[name] for name in plan.parameters]
        self._rows = [k for k, place in enumerate(places) if place.member == position]
        self._names = [places[k].name for k in self._rows]
        self._ports: Ports = make_ports(self._member.description, self._names, part.library.setters())
        strings = [(network.places[name], text) for name, text in plan.strings]
        self._strings = [(place.name, text) for place, text in strings if place.member == position]

    def enter(self) -> None:
        """Set the parameters and enter initialisation mode."""
        self._lifecycle.enter(self._plan, self._set_parameters)

    def leave(self, tables: SystemTables) -> None:
        """Leave initialisation mode, and the event mode that follows it in model exchange and in FMI 3."""
        self._lifecycle.leave()
        tables.begin(self._position)
        library = self._part.library
        if steps_with_events(self._member):
            names = ("DoStep", "EnterEventMode", "UpdateDiscreteStates", "EnterStepMode")
            functions = (library.component, *(library.address(name) for name in names), 3, 1)
            status, where = enter_step_mode(functions)
            if where != loop_numbers.DONE:
                what = what_stopped(loop_numbers, status, where)
                raise SimulationError(f"{self._member.name}: {what} at t = 0 s", time=0.0)

    def terminate(self) -> None:
        """End the simulation."""
        self._lifecycle.terminate()

    def _set_parameters(self) -> None:
        self._part.set_strings(self._strings)
        if not self._rows:
            return
        values = self._room.parameters[self._rows]
        if self._ports.is_limited:
            check_range(self._member.name, self._names, self._ports, values[:, np.newaxis])
        library = self._part.library
        status = write_row(
            library.component, self._member.description.major, self._ports.table, values.ctypes.data
        )
        if status > 1:
            raise SimulationError(
                f"{self._member.name}: setting the parameters returned {status_name(status)}", time=0.0
            )


def warm_up() -> None:
    """Load what every simulation of a system needs, so that processes forked from this one need not."""
    report = np.zeros(4, dtype=np.int64)
    loops.start_round(0, 0, 1, 1e-9, 0, report)
    loops.record(0, 0, 0, 0, 0, report)
    row = np.zeros(loops.COMPONENT_WIDTH, dtype=np.int64)
    loops.read_signals(row.ctypes.data, 0.0)
    is_jacobi = False
    loops.co_simulate_system(0, 0, is_jacobi, 1e-9, 1, 1, 0, 0, 1.0, 1, 0, 0, 1, 0, report)
