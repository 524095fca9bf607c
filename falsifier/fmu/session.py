"""One FMU instance that is simulated again and again: the life cycle around the compiled loops."""

import time
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from falsifier.errors import FalsifierError, SimulationError
from falsifier.fmu.description import Description
from falsifier.fmu.library import Library, LogSink, status_name
from falsifier.fmu.lifecycle import make_lifecycle
from falsifier.fmu.order import Reuse
from falsifier.fmu.plan import Plan
from falsifier.fmu.ports import Ports, make_ports
from falsifier.fmu.room import Room
from falsifier.model import Interface

_CHEAPEST_FIRST: tuple[Reuse, ...] = ("reset", "instance")

_STEPS_PER_CLOCK_LOOK = 256


class Session:
    """A loaded FMU and how to simulate it according to a plan.

    Args:
        description: of the FMU.
        folder: where it was extracted.
        interface: how it is simulated.
        log: receives the FMU's messages.

    Raises:
        ModelError: when the FMU cannot be loaded.
    """

    def __init__(self, description: Description, folder: Path, interface: Interface, log: LogSink) -> None:
        self._description = description
        self._library = Library(description, folder, interface, log)
        self._lifecycle = make_lifecycle(self._library)
        self._state: Literal["new", "broken", "finished"] = "new"
        self.reuse: Reuse = "instance"

    def prepare(self, plan: Plan, room: Room) -> None:
        """Look up what the simulations of a plan need.

        Raises:
            ModelError: when the library lacks functions for the plan's variables.
        """
        self._plan, self._room = plan, room
        self._stepper = CoSimulation(self._description, self._library, plan, room)

    def run(self) -> None:
        """Simulate once: from the room's parameters and inputs to its outputs.

        Raises:
            SimulationError: when there is no full trajectory.
        """
        deadline = time.perf_counter() + self._plan.time_limit
        if self._state != "new":
            can_reset = self._state == "finished" and self.reuse == "reset"
            if not (can_reset and self._lifecycle.reset()):
                self._library.renew()
        self._state = "broken"
        self._lifecycle.initialise(self._plan, self._stepper.set_parameters, self._stepper.set_first_inputs)
        self._stepper.advance(deadline)
        self._lifecycle.terminate()
        self._state = "finished"

    def find_reuse(self) -> Reuse:
        """Find out what makes a second simulation equal to the first one, whose outcome is in the room.

        The room stays as it is. A model whose runs differ even in new instances gets a new process each time:
        its library keeps something from run to run.
        """
        plan, room = self._plan, self._room
        expected = room.outputs.copy()
        trial = Room(room.parameters.copy(), room.inputs.copy(), np.zeros_like(room.outputs))
        self.prepare(plan, trial)
        found: Reuse = "process"
        for reuse in _CHEAPEST_FIRST:
            self.reuse = reuse
            trial.outputs[:] = 0.0
            try:
                self.run()
            except FalsifierError:
                continue
            if np.array_equal(trial.outputs, expected, equal_nan=True):
                found = reuse
                break
        self.prepare(plan, room)
        self.reuse = found
        return found

    def close(self) -> None:
        """Free the instance and unload the library."""
        self._library.close()


class CoSimulation:
    """Steps one co-simulation FMU through a plan."""

    def __init__(self, description: Description, library: Library, plan: Plan, room: Room) -> None:
        self._loops = loops()
        self._name = description.info.name
        self._library, self._plan, self._room = library, plan, room
        self._in_event_mode = description.major == 3 and description.event_mode
        variability = {v.name: v.variability for v in description.info.variables}
        held = [self._in_event_mode and variability[name] != "continuous" for name in plan.inputs]
        self._continuous_rows = np.flatnonzero(~np.array(held, dtype=bool))
        self._discrete_rows = np.flatnonzero(np.array(held, dtype=bool))
        names = np.array(plan.inputs, dtype=object)
        getters, setters = library.getters(), library.setters()
        self._parameters = make_ports(description, plan.parameters, setters)
        self._continuous = make_ports(description, list(names[self._continuous_rows]), setters)
        self._discrete = make_ports(description, list(names[self._discrete_rows]), setters)
        self._outputs = make_ports(description, plan.outputs, getters)
        self._report = np.zeros(3, dtype=np.int64)
        functions = ("DoStep", "EnterEventMode", "UpdateDiscreteStates", "EnterStepMode")
        self._functions = np.array(
            [0, *map(library.address, functions), description.major, self._in_event_mode], dtype=np.int64
        )

    def set_parameters(self) -> None:
        """Set the plan's parameters and start values."""
        self._write(self._parameters, self._room.parameters[:, np.newaxis], "parameters")

    def set_first_inputs(self) -> None:
        """Set the inputs at time 0."""
        self._write(self._continuous, self._room.inputs[self._continuous_rows], "inputs")
        self._write(self._discrete, self._room.inputs[self._discrete_rows], "inputs")

    def advance(self, deadline: float) -> None:
        """Do all steps and record the outputs.

        Raises:
            SimulationError: when a step fails, or the clock passes the deadline.
        """
        plan, room, loops, report = self._plan, self._room, self._loops, self._report
        self._functions[0] = self._library.component
        if self._in_event_mode:
            status, where = loops.enter_step_mode(self._functions)
            self._check(status, where, 0.0)
        version = int(self._functions[loops.FMI_VERSION])
        instance = int(self._functions[loops.INSTANCE])
        status = loops.read_row(instance, version, self._outputs.calls, self._outputs.places, room.outputs, 0)
        self._check(status, loops.GETTING if status > 1 else loops.DONE, 0.0)
        step = plan.stop_time / plan.steps
        continuous, discrete = self._rows()
        for first in range(0, plan.steps, _STEPS_PER_CLOCK_LOOK):
            last = min(first + _STEPS_PER_CLOCK_LOOK, plan.steps)
            loops.co_simulate(
                self._functions,
                self._continuous.calls,
                self._continuous.places,
                self._discrete.calls,
                self._discrete.places,
                self._outputs.calls,
                self._outputs.places,
                continuous,
                discrete,
                room.outputs,
                step,
                first,
                last,
                plan.every,
                report,
            )
            reached = float(report[loops.STEP] * step)
            if report[loops.WHERE] == loops.TERMINATED and report[loops.STEP] == plan.steps:
                return
            self._check(int(report[loops.STATUS]), int(report[loops.WHERE]), reached)
            if last < plan.steps and time.perf_counter() > deadline:
                raise SimulationError(
                    f"{self._name}: stopped at t = {reached:g} s by the time limit of {plan.time_limit:g} s",
                    status="timeout",
                    time=reached,
                )

    def _rows(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if not self._discrete_rows.size:
            return self._room.inputs, self._room.inputs[:0]
        return self._room.inputs[self._continuous_rows], self._room.inputs[self._discrete_rows]

    def _write(self, ports: Ports, rows: NDArray[np.float64], what: str) -> None:
        if not rows.shape[0]:
            return
        outside = (rows.min(axis=1) < ports.limits[:, 0] - 0.5) | (
            rows.max(axis=1) > ports.limits[:, 1] + 0.5
        )
        if outside.any():
            k = int(np.argmax(outside))
            low, high = ports.limits[k]
            raise SimulationError(
                f"{self._name}: {what}: values from {rows[k].min():g} to {rows[k].max():g} do not fit the "
                f"variable's type, which takes {low:g} to {high:g}",
                time=0.0,
            )
        status = self._loops.write_row(
            self._library.component, self._library.description.major, ports.calls, ports.places, rows, 0
        )
        if status > 1:
            raise SimulationError(
                f"{self._name}: setting the {what} returned {status_name(status)}", time=0.0
            )

    def _check(self, status: int, where: int, reached: float) -> None:
        if where == self._loops.DONE:
            return
        if where == self._loops.TERMINATED:
            what = "the FMU ended the simulation"
        elif where == self._loops.STUCK:
            what = "the FMU makes no progress: it asks for events again and again"
        else:
            doing = {
                self._loops.SETTING: "setting the inputs",
                self._loops.STEPPING: "the step",
                self._loops.GETTING: "reading the outputs",
            }.get(where, "the event iteration")
            what = f"{doing} returned {status_name(status)}"
        raise SimulationError(
            f"{self._name}: {what} at t = {reached:g} s, before the stop time {self._plan.stop_time:g} s",
            time=reached,
        )


def loops() -> Any:
    """The compiled loops, or the plain ones where numba is not installed."""
    try:
        from falsifier.fmu import stepping
    except ImportError:
        from falsifier.fmu import plain

        return plain
    return stepping


def warm_up() -> None:
    """Load what every session needs, so that processes forked from this one find it ready."""
    import fmpy.fmi1
    import fmpy.fmi2
    import fmpy.fmi3
    import fmpy.logging  # noqa: F401

    compiled = loops()
    calls, places = np.zeros((0, 5), dtype=np.int64), np.zeros((0, 4), dtype=np.int64)
    rows, report = np.zeros((0, 1)), np.zeros(3, dtype=np.int64)
    functions = np.zeros(7, dtype=np.int64)
    compiled.write_row(0, 2, calls, places, rows, 0)
    compiled.read_row(0, 2, calls, places, rows, 0)
    compiled.co_simulate(
        functions, calls, places, calls, places, calls, places, rows, rows, rows, 1.0, 0, 0, 1, report
    )
