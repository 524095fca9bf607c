"""What is simulated repeatedly, an FMU or a system: when to reset, restore or replace its instance."""

import time
from collections.abc import Callable, Collection
from typing import Literal

import numpy as np

from falsifier.errors import FalsifierError, ModelError, SimulationError
from falsifier.fmu.buffers import Room
from falsifier.fmu.instance import Instance
from falsifier.fmu.plan import Plan
from falsifier.fmu.worker_order import REUSES, Reuse


class Session:
    """A loaded FMU or system that simulates according to a plan.

    Args:
        load: loads the libraries and makes the instance.

    Raises:
        ModelError: if that fails.
    """

    def __init__(self, load: Callable[[], Instance]) -> None:
        self._load = load
        self._instance = load()
        self._state: Literal["new", "broken", "finished"] = "new"
        self.reuse: Reuse = "instance"

    @property
    def memory_elsewhere(self) -> int:
        """See Instance."""
        return self._instance.memory_elsewhere

    def prepare(self, plan: Plan, room: Room) -> None:
        """Prepare for the simulations of a plan.

        Raises:
            ModelError: if a library lacks functions for the plan's variables.
        """
        self._plan, self._room = plan, room
        self._instance.prepare(plan, room)

    def run(self) -> None:
        """Simulate once, from the room's parameters and inputs to its outputs.

        Raises:
            SimulationError: if there is no complete trajectory.
        """
        deadline = time.perf_counter() + self._plan.time_limit
        if self._state != "new" and not self._is_brought_back():
            self._renew()
        if self._state == "new" and self.reuse == "state" and not self._instance.take():
            self.reuse = "instance"
        # Stays so if anything below raises an exception: such an instance cannot be reset reliably.
        self._state = "broken"
        self._instance.simulate(deadline)
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
        trial = Room(
            room.parameters.copy(), room.inputs.copy(), np.zeros_like(room.outputs), room.component.copy()
        )
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
        self._instance.forget()
        self._instance.close()

    def _renew(self) -> None:
        """Replace the instance; load the library again if its static data must not survive.

        That this fails says nothing about simulations with other inputs.
        """
        self._instance.forget()
        try:
            if self.reuse == "library":
                self._instance.close()
                self._instance = self._load()
                self._instance.prepare(self._plan, self._room)
            else:
                self._instance.renew()
        except ModelError as error:
            raise SimulationError(str(error)) from error
        self._state = "new"

    def _is_brought_back(self) -> bool:
        """Reset the instance after a finished simulation or restore its state; return whether that worked."""
        if self._state != "finished":
            return False
        if self.reuse == "reset" and self._instance.reset():
            return True
        if self.reuse == "state" and self._instance.restore():
            return True
        if self.reuse == "reset" or (self.reuse == "state" and self._instance.is_taken):
            self.reuse = "instance"
        return False

    def _possible(self) -> tuple[Reuse, ...]:
        """Return the ways to start again that are declared, the cheapest first."""
        saves = self._instance.saves_state
        return tuple(reuse for reuse in REUSES[:-1] if saves or reuse != "state")
