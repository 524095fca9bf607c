"""Model exchange: the FMU is a differential equation, solved by solver.py."""

import ctypes

import numpy as np
from numpy.typing import NDArray

from falsifier.errors import ModelError
from falsifier.fmu import continuous, solver
from falsifier.fmu.buffers import Room
from falsifier.fmu.continuous import Memory, Model, make_memory
from falsifier.fmu.description import Description
from falsifier.fmu.library import Library
from falsifier.fmu.lifecycle import Lifecycle
from falsifier.fmu.plan import Plan, solver_tolerance
from falsifier.fmu.stepper import Stepper

# Solver steps between two checks of the time limit.
_STEPS_PER_CLOCK_CHECK = 2000
# Absolute tolerance of a state: this share of the relative one, times its nominal value (FMI 2.0.4, 2.2.7).
_ABSOLUTE_SHARE = 0.01
# Maximum number of states, and of event indicators: an FMU may report anything.
_MOST_VALUES = 100_000

_NAMES = {
    1: (
        "SetTime", "SetContinuousStates", "GetContinuousStates", "GetDerivatives", "GetEventIndicators",
        "CompletedIntegratorStep", "", "EventUpdate", "",
    ),
    2: (
        "SetTime", "SetContinuousStates", "GetContinuousStates", "GetDerivatives", "GetEventIndicators",
        "CompletedIntegratorStep", "EnterEventMode", "NewDiscreteStates", "EnterContinuousTimeMode",
    ),
    3: (
        "SetTime", "SetContinuousStates", "GetContinuousStates", "GetContinuousStateDerivatives",
        "GetEventIndicators", "CompletedIntegratorStep", "EnterEventMode", "UpdateDiscreteStates",
        "EnterContinuousTimeMode",
    ),
}  # fmt: skip


def warm_up() -> None:
    """Compile the solver, or load it from the cache; needs no FMU."""
    from numba import typeof

    table = (0, 0, 0, 0)
    model = Model((0,) * 11, table, table, table, (0, 0), (0, 0), np.zeros(0), 1e-6, 1.0, 1.0)
    memory = make_memory(0, 0, 0)
    for function in (continuous.settle, continuous.refresh):
        function.compile((typeof(model), typeof(memory)))
    # With no column left to record, this returns before it calls the FMU.
    solver.advance(model, memory, np.zeros((0, 0)), 1)


class ModelExchange(Stepper):
    """Simulates a model-exchange FMU according to a plan."""

    def __init__(
        self, description: Description, library: Library, plan: Plan, room: Room, lifecycle: Lifecycle
    ) -> None:
        super().__init__(description, library, plan, room)
        self._lifecycle = lifecycle
        self._addresses = [library.address(name) if name else 0 for name in _NAMES[description.major]]
        self._states, self._indicators = self._sizes(description)
        self._tolerance = solver_tolerance(plan, description.info)

    def advance(self, deadline: float) -> None:
        """Solve the differential equation up to the stop time.

        Raises:
            SimulationError: if a step fails, events never end, or the deadline passes.
        """
        memory = make_memory(self._states, self._indicators, len(self._plan.inputs))
        pieces, held_pieces = self._pieces(self._other_rows), self._pieces(self._held_rows)
        model = self._model(pieces, held_pieces)
        self._begin(model, memory)
        self._read_first()
        memory.counts[continuous.COLUMN] = 1
        memory.clock[continuous.NEXT_STEP] = model.max_step
        while True:
            status, where = solver.advance(model, memory, self._room.outputs, _STEPS_PER_CLOCK_CHECK)
            reached = float(memory.clock[continuous.TIME])
            if where == solver.PAUSED:
                self._watch_clock(deadline, reached)
                continue
            self._check(status, where, reached)
            return

    def _model(self, pieces: NDArray[np.float64], held_pieces: NDArray[np.float64]) -> Model:
        nominals = np.ones(self._states)
        self._vector("GetNominalContinuousStates", "GetNominalsOfContinuousStates", nominals)
        return Model(
            functions=(self._library.component, self._library.description.major, *self._addresses),
            ports=self._inputs.table,
            held_ports=self._held_inputs.table,
            getters=self._outputs.table,
            pieces=(pieces.ctypes.data, self._plan.pieces),
            held_pieces=(held_pieces.ctypes.data, self._plan.pieces),
            weights=_ABSOLUTE_SHARE * self._tolerance * np.where(nominals > 0.0, nominals, 1.0),
            tolerance=float(self._tolerance),
            stop_time=float(self._plan.stop_time),
            max_step=float(self._plan.max_step),
        )

    def _begin(self, model: Model, memory: Memory) -> None:
        """Get from initialisation to continuous time, handling the events at time 0."""
        self._vector("GetContinuousStates", "GetContinuousStates", memory.x)
        info = self._lifecycle.first_events
        if info is None or info.iteration_converged == b"\x00":
            status, where = continuous.settle(model, memory)
        else:
            if info.terminate != b"\x00":
                self._check(0, self._loops.TERMINATED, 0.0)
            has_next = info.has_next_time != b"\x00"
            memory.clock[continuous.NEXT_EVENT] = info.next_time if has_next else np.inf
            status, where = continuous.refresh(model, memory)
        self._check(status, where, 0.0)
        if info is None:
            # Event mode may have changed the states, whether the FMU reports it or not.
            self._vector("GetContinuousStates", "GetContinuousStates", memory.x)
            status, where = continuous.refresh(model, memory)
            self._check(status, where, 0.0)

    def _vector(self, name_1: str, name: str, values: NDArray[np.float64]) -> None:
        """Get a vector with one value per state from the FMU."""
        if not values.size:
            return
        function = self._library.function(
            name_1 if self._library.description.major == 1 else name, ctypes.c_void_p, ctypes.c_size_t
        )
        status = function(self._library.component, values.ctypes.data, values.size)
        self._check(status, self._loops.GETTING if status > 1 else self._loops.DONE, 0.0)

    def _sizes(self, description: Description) -> tuple[int, int]:
        """Return the number of states and of event indicators; FMI 3 reports them only at run time."""
        if description.major < 3:
            return self._checked(description.states, description.indicators)
        sizes = []
        for name in ("GetNumberOfContinuousStates", "GetNumberOfEventIndicators"):
            size = ctypes.c_size_t()
            if (
                self._library.function(name, ctypes.c_void_p)(self._library.component, ctypes.addressof(size))
                > 1
            ):
                raise ModelError(f"{self._name}: {name} failed")
            sizes.append(size.value)
        return self._checked(*sizes)

    def _checked(self, states: int, indicators: int) -> tuple[int, int]:
        for number, what in ((states, "continuous states"), (indicators, "event indicators")):
            if not 0 <= number <= _MOST_VALUES:
                raise ModelError(f"{self._name}: {number} {what}; expected 0 to {_MOST_VALUES}")
        return states, indicators
