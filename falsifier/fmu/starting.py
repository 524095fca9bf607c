"""Starting workers: what both ways offer."""

import socket
from dataclasses import dataclass
from typing import Protocol

from falsifier.fmu.output import Output
from falsifier.fmu.sharing import Shared
from falsifier.fmu.worker_order import Order

# The process that is started imports numba and may compile the model-exchange solver, slowly on a busy
# machine.
STARTING_SECONDS = 300.0


@dataclass(frozen=True, slots=True, eq=False)
class Started:
    """A worker process that has just been started.

    Attributes:
        pid: its process id.
        sock: this process's end of the connection to it.
        output: what it prints.
    """

    pid: int
    sock: socket.socket
    output: Output


class Starter(Protocol):
    """Starts the worker processes of this process, and ends them."""

    @property
    def is_alive(self) -> bool:
        """Whether it can start workers; another one must be made if not."""

    def start(self, order: Order) -> Started:
        """Start a worker.

        Raises:
            ModelError: if the FMU cannot be unpacked, or the worker does not start.
        """

    def share(self, size: int) -> Shared:
        """Return this many bytes of memory to share with a worker."""

    def end(self, pid: int) -> int:
        """Kill a worker and what it has started; return its exit code, negative for a signal.

        One that has already ended keeps its own exit code.

        Raises:
            ModelError: if the exit code is unknown.
        """

    def close(self) -> None:
        """End all workers and remove their folder."""

    def forget(self) -> None:
        """Leave the workers to another process, of which this is a forked copy."""
