"""Simulation in worker processes: the side of the process that requests it.

Each requesting process has one nursery, from which its workers are forked, and one worker per FMU and
interface. A worker that crashes, hangs or leaks memory is replaced; the simulation that it was running raises
a SimulationError.
"""

import atexit
import contextlib
import fcntl
import json
import logging
import mmap
import os
import pickle
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import IO, cast

import numpy as np
from numpy.typing import NDArray

from falsifier.errors import FailureStatus, ModelError, SimulationError
from falsifier.fmu import nursery
from falsifier.fmu.buffers import Room
from falsifier.fmu.channel import (
    QUICK_SECONDS,
    Closed,
    Reply,
    receive_reply,
    send_request,
    watch,
)
from falsifier.fmu.environment import worker_environment
from falsifier.fmu.failure_text import how_it_ended, last_lines, simulation_error
from falsifier.fmu.plan import Plan
from falsifier.fmu.trust import Trust
from falsifier.fmu.worker import PREPARE, RUN
from falsifier.fmu.worker_order import Order, Reuse

_LOG = logging.getLogger(__name__)

# The worker checks the time limit itself; if it has not replied this long after it, it hangs and is killed.
_GRACE_SECONDS = 0.1
# Loading an FMU may start the runtime of a tool or contact a licence server.
_LOADING_SECONDS = 120.0
# The nursery imports numba and may compile the model-exchange solver, slowly on a busy machine.
_STARTING_SECONDS = 300.0
_MAX_LOG_BYTES = 64 << 10

_BOOT = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from pathlib import Path; " + (
    "from falsifier.fmu.nursery import main; main(int(sys.argv[2]), Path(sys.argv[3]))"
)


class Nursery:
    """The process from which this one's workers are forked; started at once, waited for when first needed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._root = Path(tempfile.mkdtemp(prefix="falsifier-fmu-"))
        self._sock, theirs = socket.socketpair()
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
        shutil.rmtree(self._root, ignore_errors=True)

    def forget(self) -> None:
        """Close the connection in a forked copy of this process; the nursery belongs to the original."""
        self._sock.close()

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


class _Worker:
    """One worker process, the memory shared with it, and its messages."""

    def __init__(self, owner: Nursery, order: Order) -> None:
        self._owner = owner
        self.log = _anonymous_file()
        # Append mode, so that output after take_log truncated the file starts at its new end.
        fcntl.fcntl(self.log, fcntl.F_SETFL, fcntl.fcntl(self.log, fcntl.F_GETFL) | os.O_APPEND)
        self.sock, theirs = socket.socketpair()
        with theirs:
            self.pid = owner.start_worker(order, theirs.fileno(), self.log.fileno())
        self.plan: Plan | None = None
        self.room = Room(np.empty(0), np.empty((0, 0)), np.empty((0, 0)))
        self.awaits_test = False
        self.is_quick = False
        self.logging = order.logging
        self.simulations = 0
        self.started = time.perf_counter()

    def prepare(self, plan: Plan) -> Reply:
        """Share memory for a plan with the worker, which then looks up the plan's variables."""
        size = max(Room.size(plan) * 8, 8)
        with _anonymous_file() as file:
            file.truncate(size)
            self.room = Room.over(plan, _floats(file, size))
            send_request(self.sock, PREPARE, pickle.dumps(plan), (file.fileno(),))
        reply = receive_reply(self.sock, _LOADING_SECONDS)
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
        reply = receive_reply(self.sock, limit)
        self.is_quick = time.perf_counter() - started < QUICK_SECONDS
        return reply

    def take_log(self) -> tuple[str, ...]:
        """Return the lines that the FMU has written since the last call; only the end of long output."""
        size = os.fstat(self.log.fileno()).st_size
        if not size:
            return ()
        text = os.pread(self.log.fileno(), _MAX_LOG_BYTES, max(0, size - _MAX_LOG_BYTES))
        self.log.truncate(0)
        return tuple(text.decode("utf-8", "replace").splitlines())

    def kill(self) -> int:
        """End the process; return its exit code, negative for a signal."""
        # A process that has already ended keeps its own exit code.
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)
        self.sock.close()
        self.log.close()
        try:
            return self._owner.reap(self.pid)
        except ModelError:
            # The nursery has ended, so the exit code is unknown; the next worker comes from a new nursery.
            return 0


class IsolatedFmu:
    """Simulates one FMU in a worker process, which is replaced when necessary."""

    def __init__(self, owner: Callable[[], Nursery], order: Order) -> None:
        self._owner, self._order = owner, order
        self._worker: _Worker | None = None
        self._trust = Trust()
        self._lock = threading.Lock()

    def simulate(
        self, plan: Plan, fill: Callable[[Room], None]
    ) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        """Simulate once.

        A simulation that fails in a process that has simulated before is repeated in a new one before it
        counts as failed: the reuse may be to blame. If it is, the FMU's instances are not reused any more.
        The repetition asks the FMU for messages, which most FMUs give only on request.

        Args:
            plan: what the simulations have in common.
            fill: writes parameters and inputs to the memory that the worker reads.

        Returns:
            The outputs, shape (outputs, samples), and the FMU's messages.

        Raises:
            SimulationError: if there is no complete trajectory.
            ModelError: if the FMU cannot be used.
        """
        with self._lock:
            worker = self._worker_for(plan)
            is_reused, reuse = worker.simulations > 0, self._trust.reuse
            try:
                return self._simulate(worker, plan, fill)
            except SimulationError as error:
                if not self._should_repeat(error, is_reused=is_reused):
                    raise
            repeated = self._simulate(self._speaking_worker(plan), plan, fill)
            if is_reused and reuse is not None:
                self._trust.distrust(reuse)
            return repeated

    def load(self, plan: Plan) -> None:
        """Load the library and make an instance, without a simulation.

        Raises:
            ModelError: if that fails.
        """
        with self._lock:
            self._worker_for(plan)

    def _should_repeat(self, error: SimulationError, *, is_reused: bool) -> bool:
        if error.status == "timeout" or (self._order.logging and not is_reused):
            return False
        return (is_reused and error.status == "crashed") or self._trust.is_worth_repeating()

    def _speaking_worker(self, plan: Plan) -> _Worker:
        """Return a new worker that asks the FMU for messages; it serves one simulation."""
        self._drop()
        order = replace(self._order, logging=True, reuse="process")
        worker = self._worker = _Worker(self._owner(), order)
        self._prepare(worker, plan)
        return worker

    def _simulate(
        self, worker: _Worker, plan: Plan, fill: Callable[[Room], None]
    ) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        try:
            fill(worker.room)
            worker = self._started(worker, plan, fill)
            reply = worker.wait(plan.time_limit + _GRACE_SECONDS)
        except TimeoutError:
            raise self._end(
                f"did not finish within the time limit of {plan.time_limit:g} s and was stopped; "
                "slow models need a larger time_limit",
                "timeout",
            ) from None
        except Closed:
            raise self._end("", "crashed") from None
        except BaseException:
            # Interrupted: otherwise its reply would be mistaken for that of the next simulation.
            self._drop()
            raise
        if reply.status == "unusable":
            self._drop()
            raise ModelError(reply.text)
        if reply.status != "ok":
            log = worker.take_log()
            self._drop()
            raise simulation_error(reply, log)
        outputs = worker.room.outputs.copy()
        log = worker.take_log()
        if not worker.simulations:
            self._trust.took(time.perf_counter() - worker.started)
        worker.simulations += 1
        worker.awaits_test = reply.more
        if reply.leaving:
            self._drop()
        return outputs, log

    def close(self) -> None:
        """End the worker."""
        with self._lock:
            self._drop()

    def forget(self) -> None:
        """Close the connection in a forked copy of this process; the worker belongs to the original."""
        if self._worker is not None:
            self._worker.sock.close()
            self._worker = None

    def _started(self, worker: _Worker, plan: Plan, fill: Callable[[Room], None]) -> _Worker:
        """Start the simulation, in a new worker if this one has died since its last simulation."""
        try:
            send_request(worker.sock, RUN)
        except Closed:
            self._drop()
            worker = self._worker_for(plan)
            fill(worker.room)
            send_request(worker.sock, RUN)
        return worker

    def _worker_for(self, plan: Plan) -> _Worker:
        if self._worker is not None and self._worker.awaits_test:
            self._await_test(self._worker)
        worker = self._worker
        if worker is None:
            trust = self._trust
            order = replace(self._order, reuse=trust.reuse, untrusted=trust.untrusted)
            worker = self._worker = _Worker(self._owner(), order)
        if worker.plan is plan:
            return worker
        try:
            self._prepare(worker, plan)
        except ModelError:
            if worker.logging or not self._trust.is_worth_repeating():
                raise
            # Once more, to hear why.
            return self._speaking_worker(plan)
        return worker

    def _prepare(self, worker: _Worker, plan: Plan) -> None:
        try:
            reply = worker.prepare(plan)
        except (Closed, TimeoutError) as error:
            how = "hung" if isinstance(error, TimeoutError) else "crashed"
            log = worker.take_log()
            code = self._drop()
            raise ModelError(
                f"{self._order.path}: the FMU {how} while it was loaded ({how_it_ended(code)})"
                + last_lines(log)
            ) from None
        except BaseException:
            self._drop()
            raise
        if reply.status != "ok":
            log = worker.take_log()
            self._drop()
            raise ModelError(f"{self._order.path}: {reply.text}{last_lines(log)}")

    def _await_test(self, worker: _Worker) -> None:
        """Receive the result of the worker's reuse test; what crashed or hung is not tried again."""
        worker.awaits_test = False
        trust = self._trust
        try:
            reply = receive_reply(worker.sock, trust.patience)
            while reply.more:
                trust.trying = cast(Reuse, reply.text)
                reply = receive_reply(worker.sock, trust.patience)
        except (Closed, TimeoutError):
            trust.distrust(trust.trying)
            self._drop()
            return
        except BaseException:
            self._drop()
            raise
        worker.take_log()
        trust.reuse = cast(Reuse, reply.text)
        if reply.leaving:
            self._drop()

    def _end(self, reason: str, status: FailureStatus) -> SimulationError:
        worker = self._worker
        assert worker is not None, "_end is called during a simulation"
        log = worker.take_log()
        code = self._drop()
        name = self._order.description.info.name
        reason = reason or f"the FMU's process crashed: {how_it_ended(code)}"
        return SimulationError(f"{name}: {reason}" + last_lines(log), status=status, log=log)

    def _drop(self) -> int:
        worker, self._worker = self._worker, None
        return 0 if worker is None else worker.kill()


def _anonymous_file() -> IO[bytes]:
    """Open a file without a name, in memory if the system supports that."""
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("falsifier-fmu"), "w+b")
    return tempfile.TemporaryFile()


def _floats(file: IO[bytes], size: int) -> NDArray[np.float64]:
    return np.frombuffer(mmap.mmap(file.fileno(), size), dtype=np.float64)


class _Registry:
    """Nursery and workers of this process; a forked copy of the process starts without any."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._nursery: Nursery | None = None
        self._fmus: dict[tuple[str, str, bool], IsolatedFmu] = {}
        atexit.register(self.close)
        os.register_at_fork(after_in_child=self.forget)

    def nursery(self) -> Nursery:
        with self._lock:
            if self._nursery is not None and not self._nursery.is_alive:
                self._nursery.close()
                self._nursery = None
            if self._nursery is None:
                self._nursery = Nursery()
            return self._nursery

    def fmu(self, order: Order) -> IsolatedFmu:
        key = (order.sha256, order.interface, order.logging)
        found = self._fmus.get(key)
        if found is None:
            with self._lock:
                found = self._fmus.setdefault(key, IsolatedFmu(self.nursery, order))
        return found

    def drop(self, sha256: str, interface: str, *, logging: bool = False) -> None:
        with self._lock:
            found = self._fmus.pop((sha256, interface, logging), None)
        if found is not None:
            found.close()

    def close(self) -> None:
        with self._lock:
            fmus, self._fmus = self._fmus, {}
            owner, self._nursery = self._nursery, None
        for fmu in fmus.values():
            with contextlib.suppress(ModelError):
                fmu.close()
        if owner is not None:
            owner.close()

    def forget(self) -> None:
        self._lock = threading.Lock()
        for fmu in self._fmus.values():
            fmu.forget()
        if self._nursery is not None:
            self._nursery.forget()
        self._fmus, self._nursery = {}, None


REGISTRY = _Registry()
