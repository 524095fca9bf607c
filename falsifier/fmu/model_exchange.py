"""Model exchange: the FMU is a differential equation, solved by solver.py."""

from falsifier.fmu import equation, loops, solver_memory, solver_row
from falsifier.fmu.buffers import Room
from falsifier.fmu.description import Description
from falsifier.fmu.library import Library
from falsifier.fmu.lifecycle import Lifecycle
from falsifier.fmu.plan import Plan
from falsifier.fmu.solver_memory import make_memory
from falsifier.fmu.stepper import Stepper

# Solver steps between two checks of the time limit.
_STEPS_PER_CLOCK_CHECK = 2000


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
        row = solver_row.make_row()
        solver_row.fill(row, model, memory)
        solver_row.record_to(row, self._room.outputs)
        solved.begin(row, memory, self._lifecycle)
        self._read_first()
        memory.counts[solver_memory.COLUMN] = 1
        while True:
            status, where = loops.advance(row, _STEPS_PER_CLOCK_CHECK)
            reached = float(memory.clock[solver_memory.TIME])
            if where == loops.PAUSED:
                self._watch_clock(deadline, reached)
                continue
            self._check(status, where, reached)
            return
