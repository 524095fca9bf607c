"""The solver of a system's model-exchange component: its row, its memory, the lines of its inputs."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from falsifier.fmu import coupled_solver as solver
from falsifier.fmu import equation, machine_code, solver_row
from falsifier.fmu.instance import FmuInstance
from falsifier.fmu.loop_numbers import DONE
from falsifier.fmu.plan import Plan
from falsifier.fmu.ports import Ports
from falsifier.fmu.solver_memory import NEXT_EVENT, Memory, make_memory
from falsifier.fmu.stepper import component_failure
from falsifier.fmu.systems.network import Member


class SystemSolver:
    """Solves one component of a system.

    An unconnected input follows its signal as it does alone. The first piece of a connected one is the line
    that the loops write before each step.

    Args:
        member: the component.
        part: its loaded FMU.
        plan: what the simulations have in common.
        ports: continuous inputs, and those that may change only at events.

    Attributes:
        address: address of the function that does a step.
        row: see coupled_solver.py.
        lines: pieces of all inputs, shape (inputs, pieces, 5).

    Raises:
        ModelError: if the library does not tell its sizes.
    """

    def __init__(self, member: Member, part: FmuInstance, plan: Plan, ports: tuple[Ports, Ports]) -> None:
        self._member, self._part, self._plan, self._ports = member, part, plan, ports
        self._equation = equation.Equation(member.description, part.library, plan, self._check)
        inputs = len(ports[0].places) + len(ports[1].places)
        states, indicators = self._equation.states, self._equation.indicators
        self._memory: Memory = make_memory(states, indicators, inputs)
        self._kept = np.zeros(solver.kept_numbers(states, indicators, inputs))
        self.lines: NDArray[np.float64] = np.zeros((inputs, plan.pieces, 5))
        self.address = solver.address()
        self.row: NDArray[np.int64] = solver_row.make_row()

    def start_again(self, written: Sequence[tuple[NDArray[np.float64], float, float] | None]) -> None:
        """Forget the last simulation.

        Args:
            written: of each input that a signal drives, its pieces, and factor and offset of the conversion;
                None for connected ones.
        """
        for values in self._memory:
            values.fill(0)
        self._memory.clock[NEXT_EVENT] = np.inf
        self.lines.fill(0.0)
        self.lines[:, 1:, 0] = np.inf
        for line, driven in zip(self.lines, written, strict=True):
            if driven is not None:
                pieces, factor, offset = driven
                line[:, 0], line[:, 1:] = pieces[:, 0], factor * pieces[:, 1:]
                line[:, 1] += offset

    def begin(self, first: Sequence[float | None]) -> None:
        """Get from initialisation to continuous time.

        Args:
            first: values of the connected inputs at time 0; None for the others.

        Raises:
            SimulationError: if that fails.
        """
        for line, value in zip(self.lines, first, strict=True):
            if value is not None:
                line[0, 1] = value
        plain, held = self._ports
        split = self.lines[len(plain.places) :]
        count = self._plan.pieces
        address = self.lines.ctypes.data
        after = address + self.lines.strides[0] * len(plain.places) if split.size else 0
        self._model = self._equation.model(
            (plain.table, held.table), (0, 0, 0, 0), ((address, count), (after, count))
        )
        solver_row.fill(self.row, self._model, self._memory)
        self.row[solver_row.KEPT] = self._kept.ctypes.data
        self._equation.begin(self.row, self._memory, self._part.lifecycle)

    def _check(self, status: int, where: int, reached: float) -> None:
        if where != DONE:
            raise component_failure(self._member.name, status, where, reached, self._plan.stop_time)


def warm_up() -> None:
    """Compile the solver, or load it from the cache; needs no FMU."""
    machine_code.load("model_exchange")
    solver.address()
