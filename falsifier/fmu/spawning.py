"""Workers that are programs of their own: the side of the process that requests simulations.

This needs nothing but what Linux, macOS and Windows all have: a program, a connection and mapped files. The
program imports everything before it is told which FMU to load. Once a process has needed a second worker,
the next one is started in advance, so that replacing a worker takes no longer than loading the FMU.
"""

import contextlib
import logging
import pickle
import tempfile
import threading
from pathlib import Path

from falsifier.core import operating_system
from falsifier.errors import ModelError
from falsifier.fmu import sharing, spawned
from falsifier.fmu.channel import Closed, open_channel, receive_reply, send_request
from falsifier.fmu.failure_text import last_lines
from falsifier.fmu.opening import extracted
from falsifier.fmu.output import Output
from falsifier.fmu.sharing import Shared
from falsifier.fmu.starting import STARTING_SECONDS, Started, open_folder, start_program
from falsifier.fmu.worker_order import Order

_LOG = logging.getLogger(__name__)


class Spawner:
    """Starts each worker as a program; the first one at once, before it is known what it will simulate."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._folder = open_folder()
        self._root = self._folder.path
        self._workers: dict[int, _Program] = {}
        self._needed = 0
        self._spare: _Program | None = _Program(self._root)

    @property
    def is_alive(self) -> bool:
        """Always: there is no process on which the workers depend but this one."""
        return True

    def start(self, order: Order) -> Started:
        """Give the order to a program that waits for one, or to a new one; see ``Starter.start``."""
        with self._lock:
            folder = extracted(order, self._root)
            program = self._take_spare() or _Program(self._root)
            self._workers[program.pid] = program
            self._needed += 1
        try:
            program.become_worker(order, folder)
        except BaseException:
            program.sock.close()
            self.end(program.pid)
            raise
        finally:
            self._keep_spare()
        return Started(program.pid, program.sock, program.output)

    def share(self, size: int) -> Shared:
        """Return memory in a file that is sent; where files cannot be sent, in one in the workers' folder."""
        if operating_system.SENDS_FILES:
            return sharing.share_unnamed(size)
        return sharing.share_named(size, self._root)

    def end(self, pid: int) -> int:
        """Kill a worker; see ``Starter.end``."""
        with self._lock:
            program = self._workers.pop(pid, None)
        return 0 if program is None else program.end()

    def close(self) -> None:
        """End all workers and remove their folder."""
        with self._lock:
            programs = [*self._workers.values(), *filter(None, [self._spare])]
            self._workers, self._spare = {}, None
        for program in programs:
            program.end()
        self._folder.remove()

    def forget(self) -> None:
        """Leave the workers to another process, of which this is a forked copy."""
        for program in (*self._workers.values(), *filter(None, [self._spare])):
            program.forget()
        self._folder.forget()

    def _take_spare(self) -> "_Program | None":
        spare, self._spare = self._spare, None
        if spare is not None and not spare.is_alive:
            spare.end()
            return None
        return spare

    def _keep_spare(self) -> None:
        with self._lock:
            if self._needed > 1 and self._spare is None:
                with contextlib.suppress(OSError):  # reported when it is needed
                    self._spare = _Program(self._root)


class _Program:
    """One program, which waits for an order and becomes a worker."""

    def __init__(self, root: Path) -> None:
        self.output = Output()
        self._scratch = Path(tempfile.mkdtemp(prefix="work-", dir=root))
        self.sock, theirs = open_channel()
        self._child = start_program(spawned.__name__, root, theirs, self.output.fileno())
        self.pid = self._child.pid
        self._life = operating_system.open_life(self.pid)

    @property
    def is_alive(self) -> bool:
        """Whether the process is running."""
        return self._child.is_alive

    def become_worker(self, order: Order, folder: Path) -> None:
        """Wait until it has imported everything, and let it become a worker.

        Raises:
            ModelError: if it does not.
        """
        try:
            self._receive()
            self._child.settle()
            send_request(self.sock, spawned.START, pickle.dumps((order, folder, self._scratch)))
            self._receive()
        except (Closed, TimeoutError) as error:
            how = "hangs" if isinstance(error, TimeoutError) else "has ended"
            log = self.output.take()
            raise ModelError(
                f"the worker process {how} before it could load the FMU{last_lines(log)}"
            ) from error

    def end(self) -> int:
        """Kill the process, and remove its folder; return its exit code."""
        code = self._child.end()
        self.sock.close()
        self.output.close()
        if self._life is not None:
            operating_system.close_life(self._life)
            self._life = None
        operating_system.remove_tree(self._scratch)
        return code

    def forget(self) -> None:
        """Leave the process to another one, of which this is a copy."""
        self.sock.close()
        self._child.forget()

    def _receive(self) -> None:
        """Wait for the reply to a request; what is said before is told to the user."""
        reply = receive_reply(self.sock, STARTING_SECONDS, self._life)
        while reply.more:
            _LOG.warning(reply.text)
            reply = receive_reply(self.sock, STARTING_SECONDS, self._life)
        if reply.status != "ok":
            raise ModelError(reply.text)
