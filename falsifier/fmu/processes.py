"""The processes that simulate FMUs, as the process that requests simulations sees them.

The nursery is started once; workers are forked from it, one per FMU, interface and thread.
"""

import contextlib
import json
import logging
import mmap
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from falsifier.core.memory import check_memory_limits
from falsifier.errors import ModelError
from falsifier.fmu import folders, nursery, posix
from falsifier.fmu.buffers import Room
from falsifier.fmu.channel import (
    QUICK_SECONDS,
    Closed,
    Reply,
    open_channel,
    receive_reply,
    send_request,
    watch,
)
from falsifier.fmu.environment import protect_secrets, worker_environment
from falsifier.fmu.output import Output
from falsifier.fmu.plan import Plan
from falsifier.fmu.worker import PREPARE
from falsifier.fmu.worker_order import Order

_LOG = logging.getLogger(__name__)

# The worker checks the time limit itself; if it has not replied this long after it, it hangs and is killed.
GRACE_SECONDS = 0.1
# The nursery imports numba and may compile the model-exchange solver, slowly on a busy machine.
_STARTING_SECONDS = 300.0

_BOOT = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from pathlib import Path; " + (
    "from falsifier.fmu.nursery import main; main(int(sys.argv[2]), Path(sys.argv[3]))"
)


class Nursery:
    """The process from which this one's workers are forked; started at once, waited for when first needed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        check_memory_limits()
        protect_secrets(os.environ)
        folders.sweep()
        self._folder = folders.WorkFolder()
        self._root = self._folder.path
        self._sock, theirs = open_channel()
        paths = json.dumps([str(Path(p).absolute()) for p in sys.path])
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-c", _BOOT, paths, str(theirs.fileno()), str(self._root)],
                env=worker_environment(os.environ),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )
        self._ready = False

    @property
    def is_alive(self) -> bool:
        """Whether the process is running."""
        return self._process.poll() is None

    def start_worker(self, order: Order, connection: int, log: int) -> int:
        """Fork a worker that serves the connection; return its process id.

        Raises:
            ModelError: if the FMU cannot be unpacked or the nursery has ended.
        """
        return int(self._ask(nursery.START, pickle.dumps(order), (connection, log)))

    def reap(self, pid: int) -> int:
        """Wait for a worker to end; return its exit code, negative for a signal."""
        return int(self._ask(nursery.REAP, str(pid).encode(), ()))

    def close(self) -> None:
        """End the process with all its workers and remove its folder."""
        self._sock.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
        self._process.kill()
        self._process.wait()
        self._folder.remove()

    def forget(self) -> None:
        """Close the connection in a forked copy of this process; the nursery belongs to the original."""
        self._sock.close()
        self._folder.forget()

    def _ask(self, kind: int, payload: bytes, descriptors: tuple[int, ...]) -> str:
        with self._lock:
            try:
                if not self._ready:
                    receive_reply(self._sock, _STARTING_SECONDS)
                    self._ready = True
                send_request(self._sock, kind, payload, descriptors)
                reply = receive_reply(self._sock, _STARTING_SECONDS)
                while reply.more:
                    _LOG.warning(reply.text)
                    reply = receive_reply(self._sock, _STARTING_SECONDS)
            except (Closed, TimeoutError) as error:
                raise ModelError(
                    "the process that starts the FMU workers has ended or hangs; see the messages above"
                ) from error
        if reply.status != "ok":
            raise ModelError(reply.text)
        return reply.text


class WorkerProcess:
    """One worker process, the memory shared with it, and its messages."""

    def __init__(self, owner: Nursery, order: Order) -> None:
        self._owner = owner
        self._output = Output()
        self.sock, theirs = open_channel()
        with theirs:
            self.pid = owner.start_worker(order, theirs.fileno(), self._output.fileno())
        self._life = posix.open_life(self.pid)
        self.plan: Plan | None = None
        self.room = Room(np.empty(0), np.empty((0, 0)), np.empty((0, 0)), np.zeros(1))
        self.awaits_test = False
        self.is_quick = False
        self.logging = order.logging
        self.simulations = 0
        self.started = time.perf_counter()

    def prepare(self, plan: Plan) -> Reply:
        """Share memory for a plan with the worker, which then looks up the plan's variables."""
        size = max(Room.size(plan) * 8, 8)
        with posix.sealed_file(size) as file:
            self.room = Room.over(plan, _floats(file, size))
            send_request(self.sock, PREPARE, pickle.dumps(plan), (file.fileno(),))
        reply = self.receive(plan.time_limit + GRACE_SECONDS)
        self.plan = plan if reply.status == "ok" else None
        return reply

    def wait(self, limit: float) -> Reply:
        """Return the outcome of the simulation under way, waiting at most ``limit`` seconds.

        Raises:
            TimeoutError: if there is none by then.
            Closed: if the process has died.
        """
        started = time.perf_counter()
        if self.is_quick:
            watch(self.sock, QUICK_SECONDS)
        reply = self.receive(limit)
        self.is_quick = time.perf_counter() - started < QUICK_SECONDS
        return reply

    def receive(self, limit: float) -> Reply:
        """Wait for a reply; see receive_reply."""
        return receive_reply(self.sock, limit, self._life)

    def take_log(self) -> tuple[str, ...]:
        """Return the lines that the FMU has written since the last call; only the end of long output."""
        return self._output.take()

    def kill(self) -> int:
        """End the process; return its exit code, negative for a signal."""
        # A process that has already ended keeps its own exit code.
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)
        self.sock.close()
        self._output.close()
        if self._life is not None:
            os.close(self._life)
            self._life = None
        try:
            return self._owner.reap(self.pid)
        except ModelError:
            # The nursery has ended, so the exit code is unknown; the next worker comes from a new nursery.
            return 0


def _floats(file: IO[bytes], size: int) -> NDArray[np.float64]:
    return np.frombuffer(mmap.mmap(file.fileno(), size), dtype=np.float64)
