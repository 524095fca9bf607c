"""An FMU that is simulated repeatedly: when to reset, restore or replace its instance."""

import time
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from falsifier.core.model import Interface
from falsifier.errors import FalsifierError, ModelError, SimulationError
from falsifier.fmu.buffers import Room
from falsifier.fmu.co_simulation import CoSimulation
from falsifier.fmu.description import Description
from falsifier.fmu.library import Library, LogSink
from falsifier.fmu.lifecycle import make_lifecycle
from falsifier.fmu.plan import Plan
from falsifier.fmu.saved_state import SavedState
from falsifier.fmu.stepper import Stepper
from falsifier.fmu.worker_order import REUSES, Reuse


class Session:
    """A loaded FMU that simulates according to a plan.

    Args:
        description: description of the FMU.
        folder: folder to which it was extracted.
        interface: interface to simulate with.
        log: called with each of the FMU's messages.
        logging: whether to ask the FMU for messages.

    Raises:
        ModelError: if the FMU cannot be loaded.
    """

    def __init__(
        self,
        description: Description,
        folder: Path,
        interface: Interface,
        log: LogSink,
        *,
        logging: bool = False,
    ) -> None:
        self._description = description
        self._make_library = partial(Library, description, folder, interface, log, logging=logging)
        self._load()
        self.reuse: Reuse = "instance"

    def _load(self) -> None:
        self._library = self._make_library()
        self._lifecycle = make_lifecycle(self._library)
        self._saved = SavedState(self._library)
        self._state: Literal["new", "broken", "finished"] = "new"

    def prepare(self, plan: Plan, room: Room) -> None:
        """Prepare for the simulations of a plan.

        Raises:
            ModelError: if the library lacks functions for the plan's variables.
        """
        self._plan, self._room = plan, room
        self._stepper = self._make_stepper(plan, room)

    def run(self) -> None:
        """Simulate once, from the room's parameters and inputs to its outputs.

        Raises:
            SimulationError: if there is no complete trajectory.
        """
        deadline = time.perf_counter() + self._plan.time_limit
        if self._state != "new" and not self._is_brought_back():
            self._renew()
        if self._state == "new" and self.reuse == "state" and not self._saved.take():
            self.reuse = "instance"
        # Stays so if anything below raises an exception: such an instance cannot be reset reliably.
        self._state = "broken"
        self._lifecycle.initialise(self._plan, self._stepper.set_parameters, self._stepper.set_first_inputs)
        self._stepper.advance(deadline)
        self._lifecycle.terminate()
        self._state = "finished"

    def find_reuse(
        self, untrusted: Collection[Reuse] = (), announce: Callable[[Reuse], None] = lambda _: None
    ) -> Reuse:
        """Find the cheapest way to start again that reproduces the outputs of the first simulation.

        These are in the room, which is not changed. If even a library that was loaded again gives other
        outputs, each simulation needs a new process.

        Args:
            untrusted: ways not to try.
            announce: called before each trial, which may crash or hang.
        """
        plan, room = self._plan, self._room
        expected = room.outputs.copy()
        trial = Room(room.parameters.copy(), room.inputs.copy(), np.zeros_like(room.outputs))
        self.prepare(plan, trial)
        found: Reuse = "process"
        for reuse in self._possible():
            if reuse in untrusted:
                continue
            announce(reuse)
            self.reuse = reuse
            try:
                if reuse == "state":
                    self.run()  # saves the state from which the next simulations start
                    self.run()  # starts from it once; the run below shows that it can be restored repeatedly
                trial.outputs[:] = 0.0
                self.run()
            except FalsifierError:
                continue
            # If the instance rejected its reset or its state, it was replaced; then this way was not tested.
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

    def _renew(self) -> None:
        """Replace the instance; load the library again if its static data must not survive.

        That this fails says nothing about simulations with other inputs.
        """
        self._saved.forget()
        try:
            if self.reuse == "library":
                self._library.close()
                self._load()
                self._stepper = self._make_stepper(self._plan, self._room)
            else:
                self._library.renew()
        except ModelError as error:
            raise SimulationError(str(error)) from error
        self._state = "new"

    def _is_brought_back(self) -> bool:
        """Reset the instance after a finished simulation or restore its state; return whether that worked."""
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
        """Return the ways to start again that the FMU declares, the cheapest first."""
        saves = self._library.interface in self._description.saves_state
        return tuple(reuse for reuse in REUSES[:-1] if saves or reuse != "state")

    def _make_stepper(self, plan: Plan, room: Room) -> Stepper:
        if self._library.interface == "co-simulation":
            return CoSimulation(self._description, self._library, plan, room)
        # The solver takes seconds to compile and is not needed for co-simulation.
        from falsifier.fmu.model_exchange import ModelExchange

        return ModelExchange(self._description, self._library, plan, room, self._lifecycle)
