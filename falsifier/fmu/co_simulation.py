"""Co-simulation: the FMU brings its own solver and is told when to stop and what its inputs are."""

import numpy as np
from numpy.typing import NDArray

from falsifier.fmu.description import Description
from falsifier.fmu.library import Library
from falsifier.fmu.plan import Plan
from falsifier.fmu.ports import make_ports
from falsifier.fmu.room import Room
from falsifier.fmu.stepper import Stepper, check_range

_STEPS_PER_CLOCK_LOOK = 256


class CoSimulation(Stepper):
    """Steps one co-simulation FMU through a plan."""

    def __init__(self, description: Description, library: Library, plan: Plan, room: Room) -> None:
        super().__init__(description, library, plan, room)
        in_event_mode = description.major == 3 and description.event_mode
        variability = {v.name: v.variability for v in description.info.variables}
        held = np.array([in_event_mode and variability[n] != "continuous" for n in plan.inputs], dtype=bool)
        self._held_rows, self._other_rows = np.flatnonzero(held), np.flatnonzero(~held)
        self._inputs = make_ports(description, [plan.inputs[k] for k in self._other_rows], self._setters)
        self._held_inputs = make_ports(description, [plan.inputs[k] for k in self._held_rows], self._setters)
        self._report = np.zeros(3, dtype=np.int64)
        functions = ("DoStep", "EnterEventMode", "UpdateDiscreteStates", "EnterStepMode")
        self._functions = np.array(
            [0, *map(library.address, functions), description.major, in_event_mode], dtype=np.int64
        )

    def set_first_inputs(self) -> None:
        """Set the inputs at time 0."""
        for ports, rows in ((self._inputs, self._other_rows), (self._held_inputs, self._held_rows)):
            values = self._room.inputs[rows]
            check_range(self._name, [self._plan.inputs[k] for k in rows], ports, values)
            self._write(ports, values, "inputs")

    def advance(self, deadline: float) -> None:
        """Do all communication steps; see Stepper.advance."""
        plan, loops, report = self._plan, self._loops, self._report
        self._functions[loops.INSTANCE] = self._library.component
        if self._functions[loops.EVENT_MODE]:
            status, where = loops.enter_step_mode(self._functions)
            self._check(status, where, 0.0)
        self._read_first()
        step = plan.stop_time / plan.steps
        inputs, held = self._rows()
        for first in range(0, plan.steps, _STEPS_PER_CLOCK_LOOK):
            loops.co_simulate(
                self._functions,
                self._inputs.calls,
                self._inputs.places,
                self._held_inputs.calls,
                self._held_inputs.places,
                self._outputs.calls,
                self._outputs.places,
                inputs,
                held,
                self._room.outputs,
                step,
                first,
                min(first + _STEPS_PER_CLOCK_LOOK, plan.steps),
                plan.every,
                report,
            )
            status, where, done = report.tolist()
            if done == plan.steps and where in (loops.DONE, loops.TERMINATED):
                return
            self._check(status, where, done * step)
            self._watch_clock(deadline, done * step)

    def _rows(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        inputs = self._room.inputs
        if not self._held_rows.size:
            return inputs, inputs[:0]
        return inputs[self._other_rows], inputs[self._held_rows]
