"""Model exchange: the FMU is a differential equation, solved by solver.py."""

import numpy as np

from falsifier.fmu import continuous, equation, solver
from falsifier.fmu.buffers import Room
from falsifier.fmu.continuous import make_memory
from falsifier.fmu.description import Description
from falsifier.fmu.library import Library
from falsifier.fmu.lifecycle import Lifecycle
from falsifier.fmu.plan import Plan
from falsifier.fmu.stepper import Stepper

# Solver steps between two checks of the time limit.
_STEPS_PER_CLOCK_CHECK = 2000


def warm_up() -> None:
    """Compile the solver, or load it from the cache; needs no FMU."""
    model, memory = equation.warm_up()
    # With no column left to record, this returns before it calls the FMU.
    solver.advance(model, memory, np.zeros((0, 0)), 1)


class ModelExchange(Stepper):
    """Simulates a model-exchange FMU according to a plan."""

    def __init__(
        self, description: Description, library: Library, plan: Plan, room: Room, lifecycle: Lifecycle
    ) -> None:
        super().__init__(description, library, plan, room)
        self._lifecycle = lifecycle
        self._equation = equation.Equation(description, library, plan, self._check)

    def advance(self, deadline: float) -> None:
        """Solve the differential equation up to the stop time.

        Raises:
            SimulationError: if a step fails, events never end, or the deadline passes.
        """
        solved, count = self._equation, self._plan.pieces
        memory = make_memory(solved.states, solved.indicators, len(self._plan.inputs))
        pieces, held_pieces = self._pieces(self._other_rows), self._pieces(self._held_rows)
        model = solved.model(
            (self._inputs.table, self._held_inputs.table),
            self._outputs.table,
            ((pieces.ctypes.data, count), (held_pieces.ctypes.data, count)),
        )
        solved.begin(model, memory, self._lifecycle)
        self._read_first()
        memory.counts[continuous.COLUMN] = 1
        while True:
            status, where = solver.advance(model, memory, self._room.outputs, _STEPS_PER_CLOCK_CHECK)
            reached = float(memory.clock[continuous.TIME])
            if where == solver.PAUSED:
                self._watch_clock(deadline, reached)
                continue
            self._check(status, where, reached)
            return
