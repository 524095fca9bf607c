"""A loaded model-exchange FMU as a differential equation: its functions, its sizes, its events at time 0."""

import ctypes
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from falsifier.errors import ModelError
from falsifier.fmu import loop_numbers, loops, solver_memory
from falsifier.fmu.description import Description
from falsifier.fmu.library import Library
from falsifier.fmu.lifecycle import Lifecycle
from falsifier.fmu.plan import Plan, solver_tolerance
from falsifier.fmu.ports import Addresses, Table
from falsifier.fmu.solver_memory import Memory, Model

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


class Equation:
    """A model-exchange FMU, ready to be solved.

    Args:
        description: description of the FMU.
        library: the loaded library with its instance.
        plan: what the simulations have in common.
        check: called with FMI status, where a loop stopped, and the time in s; raises errors.

    Attributes:
        states: number of continuous states.
        indicators: number of event indicators.

    Raises:
        ModelError: if the library does not tell its sizes.
    """

    def __init__(
        self,
        description: Description,
        library: Library,
        plan: Plan,
        check: Callable[[int, int, float], None],
    ) -> None:
        self._description, self._library, self._plan, self._check = description, library, plan, check
        self._addresses = [library.address(name) if name else 0 for name in _NAMES[description.major]]
        self.states, self.indicators = self._sizes()
        self._tolerance = solver_tolerance(plan, description.info)

    def model(
        self,
        inputs: tuple[Addresses, Addresses],
        getters: Addresses,
        pieces: tuple[tuple[int, int], tuple[int, int]],
    ) -> Model:
        """Return what does not change during a simulation; nominal values are known after initialisation.

        Args:
            inputs: continuous inputs, and those that may change only at events (``Ports.table``).
            getters: recorded variables.
            pieces: address and number of the pieces of the continuous inputs, and of the others.
        """
        nominals = np.ones(self.states)
        self._vector("GetNominalContinuousStates", "GetNominalsOfContinuousStates", nominals)
        return Model(
            functions=(self._library.component, self._description.major, *self._addresses),
            ports=inputs[0],
            held_ports=inputs[1],
            getters=getters,
            pieces=pieces[0],
            held_pieces=pieces[1],
            weights=_ABSOLUTE_SHARE * self._tolerance * np.where(nominals > 0.0, nominals, 1.0),
            tolerance=float(self._tolerance),
            stop_time=float(self._plan.stop_time),
            max_step=float(self._plan.max_step),
        )

    def begin(self, row: Table, memory: Memory, lifecycle: Lifecycle) -> None:
        """Get from initialisation to continuous time, handling the events at time 0.

        Args:
            row: the model and its memory (``solver_row``).
            memory: the same memory.
            lifecycle: what the initialisation has reported.
        """
        self._vector("GetContinuousStates", "GetContinuousStates", memory.x)
        memory.clock[solver_memory.NEXT_STEP] = self._plan.max_step
        info = lifecycle.first_events
        if info is None or info.iteration_converged == b"\x00":
            status, where = loops.settle(row)
        else:
            if info.terminate != b"\x00":
                self._check(0, loop_numbers.TERMINATED, 0.0)
            has_next = info.has_next_time != b"\x00"
            memory.clock[solver_memory.NEXT_EVENT] = info.next_time if has_next else np.inf
            status, where = loops.refresh(row)
        self._check(status, where, 0.0)
        if info is None:
            # Event mode may have changed the states, whether the FMU reports it or not.
            self._vector("GetContinuousStates", "GetContinuousStates", memory.x)
            status, where = loops.refresh(row)
            self._check(status, where, 0.0)

    def _vector(self, name_1: str, name: str, values: NDArray[np.float64]) -> None:
        """Get a vector with one value per state from the FMU."""
        if not values.size:
            return
        function = self._library.function(
            name_1 if self._description.major == 1 else name, ctypes.c_void_p, ctypes.c_size_t
        )
        status = function(self._library.component, values.ctypes.data, values.size)
        self._check(status, loop_numbers.GETTING if status > 1 else loop_numbers.DONE, 0.0)

    def _sizes(self) -> tuple[int, int]:
        """Return the number of states and of event indicators; FMI 3 reports them only at run time."""
        description = self._description
        if description.major < 3:
            return self._checked(description.states, description.indicators)
        sizes = []
        for name in ("GetNumberOfContinuousStates", "GetNumberOfEventIndicators"):
            size = ctypes.c_size_t()
            status = self._library.function(name, ctypes.c_void_p)(
                self._library.component, ctypes.addressof(size)
            )
            if status > 1:
                raise ModelError(f"{description.info.name}: {name} failed")
            sizes.append(size.value)
        return self._checked(*sizes)

    def _checked(self, states: int, indicators: int) -> tuple[int, int]:
        for number, what in ((states, "continuous states"), (indicators, "event indicators")):
            if not 0 <= number <= _MOST_VALUES:
                raise ModelError(
                    f"{self._description.info.name}: {number} {what}; expected 0 to {_MOST_VALUES}"
                )
        return states, indicators
