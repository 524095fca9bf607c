"""One FMU instance that is simulated again and again: the life cycle around the compiled loops."""

import time
from pathlib import Path
from typing import Literal

import numpy as np

from falsifier.core.model import Interface
from falsifier.errors import FalsifierError
from falsifier.fmu.buffers import Room
from falsifier.fmu.co_simulation import CoSimulation
from falsifier.fmu.description import Description
from falsifier.fmu.library import Library, LogSink
from falsifier.fmu.lifecycle import make_lifecycle
from falsifier.fmu.plan import Plan
from falsifier.fmu.saved_state import SavedState
from falsifier.fmu.stepper import Stepper
from falsifier.fmu.worker_order import Reuse

_CHEAPEST_FIRST: tuple[Reuse, ...] = ("reset", "state", "instance")


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
        self._saved = SavedState(self._library)
        self._state: Literal["new", "broken", "finished"] = "new"
        self.reuse: Reuse = "instance"

    def prepare(self, plan: Plan, room: Room) -> None:
        """Look up what the simulations of a plan need.

        Raises:
            ModelError: when the library lacks functions for the plan's variables.
        """
        self._plan, self._room = plan, room
        self._stepper = self._make_stepper(plan, room)

    def run(self) -> None:
        """Simulate once: from the room's parameters and inputs to its outputs.

        Raises:
            SimulationError: when there is no full trajectory.
        """
        deadline = time.perf_counter() + self._plan.time_limit
        if self._state != "new" and not self._is_brought_back():
            self._saved.forget()
            self._library.renew()
            self._state = "new"
        if self._state == "new" and self.reuse == "state" and not self._saved.take():
            self.reuse = "instance"
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
        for reuse in self._possible():
            self.reuse = reuse
            try:
                if reuse == "state":
                    self.run()  # takes the state that the next runs start from
                    self.run()  # from then on the state must serve again and again
                trial.outputs[:] = 0.0
                self.run()
            except FalsifierError:
                continue
            # An instance that refused its reset or its state was replaced: that is another way to begin.
            if self.reuse == reuse and np.array_equal(trial.outputs, expected, equal_nan=True):
                found = reuse
                break
        self.prepare(plan, room)
        self.reuse = found
        return found

    def close(self) -> None:
        """Free the instance and unload the library."""
        self._saved.forget()
        self._library.close()

    def _is_brought_back(self) -> bool:
        """Whether the instance of a finished simulation was brought back to its beginning."""
        if self._state != "finished":
            return False
        if self.reuse == "reset" and self._lifecycle.reset():
            return True
        if self.reuse == "state" and self._saved.restore():
            return True
        if self.reuse == "reset" or (self.reuse == "state" and self._saved.is_taken):
            self.reuse = "instance"
        return False

    def _possible(self) -> tuple[Reuse, ...]:
        """Ways to begin again that the FMU says it has, the cheapest first."""
        saves = self._library.interface in self._description.saves_state
        return tuple(reuse for reuse in _CHEAPEST_FIRST if saves or reuse != "state")

    def _make_stepper(self, plan: Plan, room: Room) -> Stepper:
        if self._library.interface == "co-simulation":
            return CoSimulation(self._description, self._library, plan, room)
        # The solver takes seconds to compile and is not needed for co-simulation.
        from falsifier.fmu.model_exchange import ModelExchange

        return ModelExchange(self._description, self._library, plan, room, self._lifecycle)
