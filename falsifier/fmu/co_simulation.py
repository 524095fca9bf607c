"""Co-simulation: the FMU contains its own solver; it gets inputs and communication steps."""

import time

import numpy as np

from falsifier.fmu.buffers import Room
from falsifier.fmu.description import Description
from falsifier.fmu.library import Library
from falsifier.fmu.plan import Plan
from falsifier.fmu.stepper import Stepper

# Communication steps before the time limit is first checked. If a chunk of steps took less than
# QUICK_SECONDS, the next one is larger, so that checking the clock never costs a noticeable share of the
# time.
FIRST_CHUNK, CHUNK_GROWTH, QUICK_SECONDS = 1000, 16, 0.01


class CoSimulation(Stepper):
    """Simulates a co-simulation FMU according to a plan."""

    def __init__(self, description: Description, library: Library, plan: Plan, room: Room) -> None:
        self._in_event_mode = description.major == 3 and description.event_mode
        super().__init__(description, library, plan, room)
        functions = ("DoStep", "EnterEventMode", "UpdateDiscreteStates", "EnterStepMode")
        self._addresses = [library.address(name) for name in functions]

    def advance(self, deadline: float) -> None:
        """Do all communication steps of the plan.

        Raises:
            SimulationError: if a step fails or the deadline passes.
        """
        plan, loops = self._plan, self._loops
        version = self._library.description.major
        functions = (self._library.component, *self._addresses, version, int(self._in_event_mode))
        if self._in_event_mode:
            status, where = loops.enter_step_mode(functions)
            self._check(status, where, 0.0)
        self._read_first()
        stop_time, steps = float(plan.stop_time), plan.steps
        step = stop_time / steps
        pieces, held_pieces = self._pieces(self._other_rows), self._pieces(self._held_rows)
        # The compiled loop stores the current piece (int64) and the last value (float64) of each input here.
        memory = np.zeros(2 * len(plan.inputs))
        inputs = (
            self._inputs.table,
            (pieces.ctypes.data, plan.pieces),
            self._held_inputs.table,
            (held_pieces.ctypes.data if held_pieces.size else 0, plan.pieces),
            memory.ctypes.data,
            memory.ctypes.data + 8 * len(plan.inputs),
        )
        first, chunk = 0, FIRST_CHUNK
        while first < steps:
            started = time.perf_counter()
            last = min(first + chunk, steps)
            status, where, done = loops.co_simulate(
                functions, *inputs, *self._record, stop_time, steps, first, last, plan.every
            )
            if done == steps and where in (loops.DONE, loops.TERMINATED):
                return
            self._check(status, where, done * step)
            self._watch_clock(deadline, done * step)
            first = last
            if time.perf_counter() - started < QUICK_SECONDS:
                chunk *= CHUNK_GROWTH
