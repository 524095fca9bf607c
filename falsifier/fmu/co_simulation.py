"""Co-simulation: the FMU brings its own solver and is told when to stop and what its inputs are."""

import numpy as np

from falsifier.fmu.description import Description
from falsifier.fmu.library import Library
from falsifier.fmu.plan import Plan
from falsifier.fmu.room import Room
from falsifier.fmu.stepper import Stepper
from falsifier.model import Variable

_STEPS_PER_CLOCK_LOOK = 1000


class CoSimulation(Stepper):
    """Steps one co-simulation FMU through a plan."""

    def __init__(self, description: Description, library: Library, plan: Plan, room: Room) -> None:
        self._in_event_mode = description.major == 3 and description.event_mode
        super().__init__(description, library, plan, room)
        self._report = np.zeros(3, dtype=np.int64)
        functions = ("DoStep", "EnterEventMode", "UpdateDiscreteStates", "EnterStepMode")
        self._addresses = [library.address(name) for name in functions]

    def advance(self, deadline: float) -> None:
        """Do all communication steps; see Stepper.advance."""
        plan, loops, report = self._plan, self._loops, self._report
        version = self._library.description.major
        functions = (self._library.component, *self._addresses, version, int(self._in_event_mode))
        if self._in_event_mode:
            status, where = loops.enter_step_mode(functions)
            self._check(status, where, 0.0)
        self._read_first()
        step = plan.stop_time / plan.steps
        pieces, held_pieces = self._pieces(self._other_rows), self._pieces(self._held_rows)
        current, values = np.zeros(len(plan.inputs), dtype=np.int64), np.zeros(len(plan.inputs))
        inputs = (
            self._inputs.table,
            (pieces.ctypes.data, plan.pieces),
            self._held_inputs.table,
            (held_pieces.ctypes.data, plan.pieces),
            current.ctypes.data,
            values.ctypes.data,
        )
        outputs = (self._outputs.table, self._room.outputs.ctypes.data, plan.samples)
        for first in range(0, plan.steps, _STEPS_PER_CLOCK_LOOK):
            last = min(first + _STEPS_PER_CLOCK_LOOK, plan.steps)
            loops.co_simulate(functions, *inputs, *outputs, step, first, last, plan.every, report)
            status, where, done = report.tolist()
            if done == plan.steps and where in (loops.DONE, loops.TERMINATED):
                return
            self._check(status, where, done * step)
            self._watch_clock(deadline, done * step)

    def _is_held(self, variable: Variable) -> bool:
        return self._in_event_mode and variable.variability != "continuous"
