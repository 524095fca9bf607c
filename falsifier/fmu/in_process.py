"""Simulation in this process, for benchmarks and tests: a crash of the FMU crashes this process too."""

import atexit
import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from falsifier.core.printable import printable
from falsifier.errors import SimulationError
from falsifier.fmu.buffers import Room
from falsifier.fmu.folders import WorkFolder
from falsifier.fmu.opening import open_session, unpack
from falsifier.fmu.plan import Plan
from falsifier.fmu.worker_order import Order, Reuse


class LocalFmu:
    """An FMU loaded into this process."""

    def __init__(self, order: Order) -> None:
        self._lock = threading.Lock()
        self._log: list[str] = []
        self._folder = WorkFolder()
        folder = self._folder.path
        try:
            unpack(order, folder)
            self._session = open_session(order, folder, self._say)
        except BaseException:
            self._folder.remove()
            raise
        self._plan: Plan | None = None
        self._reuse: Reuse | None = order.reuse

    def simulate(
        self, plan: Plan, fill: Callable[[Room], None]
    ) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        """Simulate once in this process; arguments, result and errors as for ``IsolatedFmu.simulate``."""
        with self._lock:
            if self._plan is not plan:
                self._room = Room.over(plan, np.zeros(Room.size(plan)))
                self._session.prepare(plan, self._room)
                self._plan = plan
            fill(self._room)
            self._log.clear()
            self._session.reuse = self._reuse or "instance"
            try:
                self._session.run()
            except SimulationError as error:
                raise SimulationError(
                    str(error), status=error.status, time=error.time, log=tuple(self._log)
                ) from None
            log = tuple(self._log)
            if self._reuse is None:
                # A new process is impossible here; a new instance is the closest alternative.
                found = self._session.find_reuse()
                self._reuse = "instance" if found == "process" else found
            return self._room.outputs.copy(), log

    def close(self) -> None:
        """Unload the library and remove the folder."""
        self._session.close()
        self._folder.remove()

    def _say(self, line: str) -> None:
        self._log.append(printable(line))


_FMUS: dict[tuple[str, str, bool, bool], LocalFmu] = {}


def fmu(order: Order) -> LocalFmu:
    """Return the FMU as loaded in this process; load it if necessary."""
    key = (order.sha256, order.interface, order.logging, order.through_wine)
    if key not in _FMUS:
        _FMUS[key] = LocalFmu(order)
    return _FMUS[key]


def drop(sha256: str, interface: str, *, logging: bool = False, through_wine: bool = False) -> None:
    """Unload an FMU, if it is loaded."""
    found = _FMUS.pop((sha256, interface, logging, through_wine), None)
    if found is not None:
        found.close()


@atexit.register
def _close_all() -> None:
    for sha256, interface, logging, through_wine in list(_FMUS):
        drop(sha256, interface, logging=logging, through_wine=through_wine)
