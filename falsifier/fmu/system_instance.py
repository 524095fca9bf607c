"""All components of a system, in one process or one each: they start, step and start again together."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import cast

from falsifier.errors import ModelError
from falsifier.fmu.buffers import Room
from falsifier.fmu.instance import FmuInstance
from falsifier.fmu.library import LogSink
from falsifier.fmu.master import Master
from falsifier.fmu.plan import Plan
from falsifier.fmu.systems.network import Network


class SystemInstance:
    """The components of a system, loaded and instantiated; see Instance.

    Args:
        network: the system.
        folder: folder to which its FMUs were extracted, in subfolders.
        log: called with each message of an FMU.
        announce: called with the position in the order of stepping of each component before it is loaded.
        logging: whether to ask the FMUs for messages.

    Raises:
        ModelError: if an FMU cannot be loaded.
    """

    def __init__(
        self,
        network: Network,
        folder: Path,
        log: LogSink,
        announce: Callable[[int], None],
        *,
        logging: bool = False,
    ) -> None:
        self._network = network
        self._parts: list[FmuInstance] = []
        self._master: Master | None = None
        make = _maker(network)
        try:
            for k, member in enumerate(network.members):
                announce(network.order.index(k))
                self._parts.append(
                    make(member.description, folder / member.folder, member.interface, log, logging=logging)
                )
        except BaseException:
            self.close()
            raise

    @property
    def saves_state(self) -> bool:
        """Whether all components declare that their state can be saved."""
        return all(part.saves_state for part in self._parts)

    @property
    def is_taken(self) -> bool:
        """Whether all components have a saved state to start from."""
        return all(part.is_taken for part in self._parts)

    @property
    def memory_elsewhere(self) -> int:
        """See Instance."""
        return sum(part.memory_elsewhere for part in self._parts)

    def prepare(self, plan: Plan, room: Room) -> None:
        """See Instance."""
        if self._master is not None:
            self._master.forget()
        self._master = Master(self._network, self._parts, plan, room)

    def simulate(self, deadline: float) -> None:
        """See Instance."""
        assert self._master is not None, "prepare must be called before simulate"
        try:
            self._master.simulate(deadline)
        finally:
            for part in self._parts:
                part.check()

    def reset(self) -> bool:
        """Reset all components; return False if one cannot."""
        return all([part.reset() for part in self._parts])

    def take(self) -> bool:
        """Save the states of all components; return False if one cannot."""
        if all([part.take() for part in self._parts]):
            return True
        self.forget()
        return False

    def restore(self) -> bool:
        """Restore the states of all components; return False if one cannot."""
        return all([part.restore() for part in self._parts])

    def forget(self) -> None:
        """Free the saved states."""
        if self._master is not None:
            self._master.forget()
        for part in self._parts:
            part.forget()

    def renew(self) -> None:
        """See Instance."""
        for part in self._parts:
            part.renew()

    def close(self) -> None:
        """See Instance."""
        for part in reversed(self._parts):
            part.close()


def _maker(network: Network) -> Callable[..., FmuInstance]:
    if network.coupling.isolation == "together":
        return FmuInstance
    if sys.platform == "linux":
        from falsifier.fmu.remote_component import RemoteComponent

        return cast(Callable[..., FmuInstance], RemoteComponent)
    raise ModelError(
        f'{network.name}: components run in processes of their own (isolation = "each") on Linux only; '
        'use isolation = "together"'
    )
