"""Co-simulation: the FMU brings its own solver and is told when to stop and what its inputs are."""

import time

import numpy as np

from falsifier.core.model import Variable
from falsifier.fmu.buffers import Room
from falsifier.fmu.description import Description
from falsifier.fmu.library import Library
from falsifier.fmu.plan import Plan
from falsifier.fmu.stepper import Stepper

# Steps before the first look at the clock; looks become rarer while they come in quick succession.
_FIRST_CHUNK, _CHUNK_GROWTH, _QUICK_SECONDS = 1000, 16, 0.01


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
        # Where the loop keeps the current piece (int64) and the last value of each input.
        memory = np.zeros(2 * len(plan.inputs))
        inputs = (
            self._inputs.table,
            (pieces.ctypes.data, plan.pieces),
            self._held_inputs.table,
            (held_pieces.ctypes.data if held_pieces.size else 0, plan.pieces),
            memory.ctypes.data,
            memory.ctypes.data + 8 * len(plan.inputs),
        )
        first, chunk = 0, _FIRST_CHUNK
        while first < plan.steps:
            started = time.perf_counter()
            last = min(first + chunk, plan.steps)
            loops.co_simulate(functions, *inputs, *self._record, step, first, last, plan.every, report)
            status, where, done = report.tolist()
            if done == plan.steps and where in (loops.DONE, loops.TERMINATED):
                return
            self._check(status, where, done * step)
            self._watch_clock(deadline, done * step)
            first = last
            if time.perf_counter() - started < _QUICK_SECONDS:
                chunk *= _CHUNK_GROWTH

    def _is_held(self, variable: Variable) -> bool:
        return self._in_event_mode and variable.variability != "continuous"
