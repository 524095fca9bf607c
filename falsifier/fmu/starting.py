"""Starting workers: what both ways offer, and what they have in common."""

import json
import os
import socket
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from falsifier.core import operating_system
from falsifier.core.memory import check_memory_limits
from falsifier.fmu import folders
from falsifier.fmu.environment import protect_secrets, worker_environment
from falsifier.fmu.output import Output
from falsifier.fmu.sharing import Shared
from falsifier.fmu.worker_order import Order

# The process that is started may have to compile the model-exchange solver, slowly on a busy machine.
STARTING_SECONDS = 300.0

_BOOT = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from pathlib import Path; " + (
    "from importlib import import_module; import_module(sys.argv[2]).main(Path(sys.argv[3]))"
)


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


def open_folder() -> folders.WorkFolder:
    """Return a new folder for the workers of this process, which is ready to start some.

    Raises:
        MachineError: if processes may not use enough memory.
    """
    check_memory_limits()
    protect_secrets(os.environ)
    folders.sweep()
    return folders.WorkFolder()


def start_program(
    module: str, root: Path, connection: socket.socket, output: int | None = None
) -> operating_system.Child:
    """Start a Python program with this process's modules and an environment without secrets.

    Args:
        module: where its ``main`` is, which gets the folder.
        root: folder of the workers.
        connection: its end of the connection, which is closed here.
        output: descriptor of a file for what it prints; None: its messages go where this process's go.
    """
    paths = json.dumps([str(Path(p).absolute()) for p in sys.path])
    command = [operating_system.interpreter(), "-I", "-c", _BOOT, paths, module, str(root)]
    return operating_system.Child(command, worker_environment(os.environ), connection, output)
