"""Which way workers are started.

On Linux they are forked from a nursery (``forking``); elsewhere each is a program of its own (``spawning``),
which works on all systems. The variable FALSIFIER_WORKERS chooses otherwise.
"""

import os
import sys

from falsifier.core import operating_system
from falsifier.errors import SpecError
from falsifier.fmu.starting import Starter

VARIABLE = "FALSIFIER_WORKERS"


def open_starter() -> Starter:
    """Return a new starter of workers.

    Raises:
        SpecError: if FALSIFIER_WORKERS is neither fork nor spawn, or asks for fork where there is none.
        MachineError: if processes may not use enough memory.
    """
    if sys.platform != "win32" and workers_fork():
        from falsifier.fmu.forking import Nursery

        return Nursery()
    from falsifier.fmu.spawning import Spawner

    return Spawner()


def workers_fork() -> bool:
    """Whether workers are forked; otherwise they are spawned.

    Raises:
        SpecError: as for ``open_starter``.
    """
    chosen = os.environ.get(VARIABLE, "")
    if chosen not in ("", "fork", "spawn"):
        raise SpecError(f"{VARIABLE} is {chosen!r}; expected fork or spawn")
    if chosen == "fork" and not operating_system.HAS_FORK:
        raise SpecError(
            f"{VARIABLE} is fork, but this system cannot fork processes; unset it, or set it to spawn"
        )
    return chosen == "fork" or (not chosen and operating_system.FORKS_BY_DEFAULT)
