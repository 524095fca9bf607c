"""What co-simulation and model exchange have in common: ports, inputs at time 0, time limit, errors."""

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.core.model import Interface, Variable
from falsifier.errors import SimulationError
from falsifier.fmu import loops as compiled_loops
from falsifier.fmu.buffers import Room
from falsifier.fmu.description import Description
from falsifier.fmu.library import Library, status_name
from falsifier.fmu.plan import Plan
from falsifier.fmu.ports import Ports, make_ports
from falsifier.fmu.process.encoding import fixed_elements
from falsifier.fmu.strings import set_strings


class Stepper(ABC):
    """Simulates an initialised FMU according to a plan, from the inputs in a room to the outputs in it.

    Args:
        description: description of the FMU.
        library: the loaded library with its instance.
        plan: what the simulations have in common.
        room: arrays of parameters, inputs and outputs.
    """

    def __init__(self, description: Description, library: Library, plan: Plan, room: Room) -> None:
        self._loops = loops()
        self._name = description.info.name
        self._library, self._plan, self._room = library, plan, room
        setters = library.setters()
        self._parameters = make_ports(description, plan.parameters, setters)
        self._outputs = make_ports(description, plan.outputs, library.getters())
        # What is recorded, the address to record to, and the length of its rows.
        self._record = (self._outputs.table, room.outputs.ctypes.data, plan.samples)
        kinds = {v.name: v for v in description.info.variables}
        held = np.array([is_held(description, library.interface, kinds[n]) for n in plan.inputs], dtype=bool)
        self._held_rows, self._other_rows = np.flatnonzero(held), np.flatnonzero(~held)
        self._fixed: list[tuple[Ports, list[int]]] = []
        self._inputs = self._input_ports(description, self._other_rows, setters)
        self._held_inputs = self._input_ports(description, self._held_rows, setters)

    def set_parameters(self) -> None:
        """Set the plan's parameters and start values."""
        set_strings(self._library, self._plan.strings)
        values = self._room.parameters
        if self._parameters.is_limited:
            check_range(self._name, self._plan.parameters, self._parameters, values[:, np.newaxis])
        self._write(self._parameters, values, "parameters")
        for ports, rows in self._fixed:
            write_fixed(ports, values[rows])

    def set_first_inputs(self) -> None:
        """Set the inputs at time 0."""
        for ports, rows in ((self._inputs, self._other_rows), (self._held_inputs, self._held_rows)):
            if not len(rows):
                continue
            pieces = self._pieces(rows)
            check_input_range(self._name, [self._plan.inputs[k] for k in rows], ports, pieces)
            self._write(ports, pieces[:, 0, 1].copy(), "inputs")

    def _input_ports(
        self, description: Description, rows: NDArray[np.intp], setters: dict[str, int]
    ) -> Ports:
        names, parameters = [self._plan.inputs[k] for k in rows], self._plan.parameters
        fixed = fixed_elements(description, names, parameters)
        ports = make_ports(description, names, setters, [parameters[k] for k in fixed])
        if fixed:
            self._fixed.append((ports, fixed))
        return ports

    def _pieces(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the pieces of some inputs, shape (rows, pieces, 5), contiguous in memory."""
        inputs = self._room.inputs
        chosen = inputs if len(rows) == len(inputs) else inputs[rows]
        return chosen.reshape(len(rows), self._plan.pieces, 5)

    @abstractmethod
    def advance(self, deadline: float) -> None:
        """Simulate to the stop time and record the outputs.

        Args:
            deadline: value of ``time.perf_counter()`` at which to give up.

        Raises:
            SimulationError: if a step fails or the deadline passes.
        """

    def _read_first(self) -> None:
        """Record the outputs at time 0."""
        version = self._library.description.major
        status = self._loops.read_row(self._library.component, version, *self._record, 0)
        self._check(status, self._loops.GETTING if status > 1 else self._loops.DONE, 0.0)

    def _write(self, ports: Ports, numbers: NDArray[np.float64], what: str) -> None:
        """Set variables to numbers, which must be contiguous in memory."""
        if not numbers.size:
            return
        version = self._library.description.major
        address = numbers.ctypes.data
        status = self._loops.write_row(self._library.component, version, ports.table, address)
        if status > 1:
            reason = f"setting the {what} returned {status_name(status)}"
            raise SimulationError(f"{self._name}: {reason}", time=0.0)

    def _check(self, status: int, where: int, reached: float) -> None:
        loops = self._loops
        if where == loops.DONE:
            return
        raise component_failure(self._name, status, where, reached, self._plan.stop_time)

    def _watch_clock(self, deadline: float, reached: float) -> None:
        if time.perf_counter() > deadline:
            raise out_of_time(self._name, self._plan, reached)


def is_held(description: Description, interface: Interface, variable: Variable) -> bool:
    """Whether an input may change only at events."""
    if interface == "co-simulation":
        return description.major == 3 and description.event_mode and variable.variability != "continuous"
    return not variable.is_continuous


def out_of_time(model: str, plan: Plan, reached: float) -> SimulationError:
    """Return the error of a simulation that reached its time limit."""
    return SimulationError(
        f"{model}: stopped at t = {reached:g} s after the time limit of {plan.time_limit:g} s; "
        "slow models need a larger time_limit",
        status="timeout",
        time=reached,
    )


def component_failure(
    name: str, status: int, where: int, reached: float, stop_time: float
) -> SimulationError:
    """Return the error for an FMU that stopped before the stop time; times in s."""
    what = what_stopped(loops(), status, where)
    return SimulationError(
        f"{name}: {what} at t = {reached:g} s, before the stop time {stop_time:g} s", time=reached
    )


def what_stopped(loops: Any, status: int, where: int) -> str:
    """Say why a compiled loop stopped before its end, from its report."""
    if where == loops.TERMINATED:
        return "the FMU terminated the simulation"
    if where == loops.STUCK:
        return "the FMU makes no progress: its events never end"
    if where == loops.TOO_SMALL:
        return "no step is small enough: the derivatives are NaN, infinite or discarded, or change too fast"
    doing = {
        loops.SETTING: "setting the inputs",
        loops.STEPPING: "the step",
        loops.GETTING: "reading the outputs",
    }.get(where, "the event iteration")
    return f"{doing} returned {status_name(status)}"


def check_range(model: str, names: Sequence[str], ports: Ports, rows: NDArray[np.float64]) -> None:
    """Reject values outside the range of a variable's type.

    Raises:
        SimulationError: naming the variable and the range of its type.
    """
    for name, (low, high), row in zip(names, ports.limits, rows, strict=True):
        if not np.isinf(low) and not (low - 0.5 <= row.min() and row.max() <= high + 0.5):
            raise SimulationError(
                f"{model}: values from {row.min():g} to {row.max():g} do not fit {name!r}, "
                f"whose type ranges from {low:g} to {high:g}",
                time=0.0,
            )


def check_input_range(model: str, names: Sequence[str], ports: Ports, pieces: NDArray[np.float64]) -> None:
    """Reject inputs outside the range of a variable's type; pieces: shape (inputs, pieces, 5).

    Raises:
        SimulationError: naming the variable and the range of its type.
    """
    if ports.is_limited:
        # Interpolated values are always between those at the ends of a piece.
        values = np.where(np.isfinite(pieces[:, :, 0]), pieces[:, :, 1], pieces[:, :1, 1])
        check_range(model, names, ports, values)


def write_fixed(ports: Ports, values: NDArray[np.float64]) -> None:
    """Write the values of the fixed elements of arrays to where the calls that set them take them from."""
    for place, value in zip(ports.fixed, values.tolist(), strict=True):
        loops().put(int(place.ctypes.data), float(value))


def loops() -> Any:
    """Return the module of the compiled loops."""
    return compiled_loops
