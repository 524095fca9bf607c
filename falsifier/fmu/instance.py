"""One loaded FMU: its library, its life cycle, and how it starts again."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from falsifier.core.model import Interface
from falsifier.fmu.buffers import Room
from falsifier.fmu.co_simulation import CoSimulation
from falsifier.fmu.description import Description
from falsifier.fmu.library import Library, LogSink
from falsifier.fmu.lifecycle import make_lifecycle
from falsifier.fmu.plan import Plan
from falsifier.fmu.saved_state import SavedState
from falsifier.fmu.stepper import Stepper
from falsifier.fmu.strings import set_strings


class Instance(Protocol):
    """What a session simulates: one FMU, or all FMUs of a system together."""

    @property
    def saves_state(self) -> bool:
        """Whether it declares that its state can be saved."""
        ...

    @property
    def is_taken(self) -> bool:
        """Whether there is a saved state to start from."""
        ...

    @property
    def memory_elsewhere(self) -> int:
        """Largest memory in KiB that other processes have used for it."""
        ...

    def prepare(self, plan: Plan, room: Room) -> None:
        """Look up the plan's variables.

        Raises:
            ModelError: if a library lacks functions for them.
        """
        ...

    def simulate(self, deadline: float) -> None:
        """Initialise, step to the stop time, terminate; from the room's inputs to its outputs.

        Raises:
            SimulationError: if there is no complete trajectory.
        """
        ...

    def reset(self) -> bool:
        """Reset to the state after instantiation; return False if that is impossible."""
        ...

    def take(self) -> bool:
        """Save the current state; return False if that is impossible."""
        ...

    def restore(self) -> bool:
        """Restore the saved state; return False if that is impossible."""
        ...

    def forget(self) -> None:
        """Free the saved state."""
        ...

    def renew(self) -> None:
        """Replace the instance with a new one from the same library.

        Raises:
            ModelError: if instantiating fails.
        """
        ...

    def close(self) -> None:
        """Free the instance and unload the library."""
        ...


class FmuInstance:
    """One FMU, loaded and instantiated.

    Args:
        description: description of the FMU.
        folder: folder to which it was extracted.
        interface: interface to simulate with.
        log: called with each of the FMU's messages.
        logging: whether to ask the FMU for messages.

    Attributes:
        library: the loaded library.
        lifecycle: the calls before and after the stepping.

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
        self.library = Library(description, folder, interface, log, logging=logging)
        self.lifecycle = make_lifecycle(self.library)
        self._saved = SavedState(self.library)

    @property
    def saves_state(self) -> bool:
        """See Instance."""
        return self.library.interface in self._description.saves_state

    @property
    def is_taken(self) -> bool:
        """See Instance."""
        return self._saved.is_taken

    @property
    def memory_elsewhere(self) -> int:
        """See Instance."""
        return 0

    def set_strings(self, strings: Sequence[tuple[str, str]]) -> None:
        """Set string variables before initialisation; see ``set_strings``."""
        set_strings(self.library, strings)

    def prepare(self, plan: Plan, room: Room) -> None:
        """See Instance."""
        self._plan = plan
        self._stepper = self._make_stepper(plan, room)

    def simulate(self, deadline: float) -> None:
        """See Instance."""
        stepper = self._stepper
        self.lifecycle.initialise(self._plan, stepper.set_parameters, stepper.set_first_inputs)
        stepper.advance(deadline)
        self.lifecycle.terminate()

    def reset(self) -> bool:
        """See Instance."""
        return self.lifecycle.reset()

    def take(self) -> bool:
        """See Instance."""
        return self._saved.take()

    def restore(self) -> bool:
        """See Instance."""
        return self._saved.restore()

    def forget(self) -> None:
        """See Instance."""
        self._saved.forget()

    def renew(self) -> None:
        """See Instance."""
        self.library.renew()

    def check(self) -> None:
        """Nothing to do: if this FMU had crashed, this process would have."""

    def close(self) -> None:
        """See Instance."""
        self.library.close()

    def _make_stepper(self, plan: Plan, room: Room) -> Stepper:
        if self.library.interface == "co-simulation":
            return CoSimulation(self._description, self.library, plan, room)
        # The solver takes seconds to compile and is not needed for co-simulation.
        from falsifier.fmu.model_exchange import ModelExchange

        return ModelExchange(self._description, self.library, plan, room, self.lifecycle)
