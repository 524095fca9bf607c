"""Simulation in worker processes: the side of the process that requests it.

Each requesting process has one nursery, from which its workers are forked, and one worker per FMU and
interface. A worker that crashes, hangs or leaks memory is replaced; the simulation that it was running raises
a SimulationError.
"""

import atexit
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
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import IO, cast, get_args

import numpy as np
from numpy.typing import NDArray

from falsifier.errors import FailureStatus, ModelError, SimulationError
from falsifier.fmu import folders, nursery, posix
from falsifier.fmu.buffers import Room
from falsifier.fmu.channel import (
    QUICK_SECONDS,
    Closed,
    Garbled,
    Reply,
    open_channel,
    receive_reply,
    send_request,
    watch,
)
from falsifier.fmu.environment import protect_secrets, worker_environment
from falsifier.fmu.output import Output
from falsifier.fmu.plan import Plan
from falsifier.fmu.worker import PREPARE, RUN
from falsifier.fmu.worker_order import Order, Reuse

_LOG = logging.getLogger(__name__)

# The worker checks the time limit itself; if it has not replied this long after it, it hangs and is killed.
_GRACE_SECONDS = 0.1
# The nursery imports numba and may compile the model-exchange solver, slowly on a busy machine.
_STARTING_SECONDS = 300.0

_BOOT = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from pathlib import Path; " + (
    "from falsifier.fmu.nursery import main; main(int(sys.argv[2]), Path(sys.argv[3]))"
)


class Nursery:
    """The process from which this one's workers are forked; started at once, waited for when first needed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
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


class _Worker:
    """One worker process, the memory shared with it, and its messages."""

    def __init__(self, owner: Nursery, order: Order) -> None:
        self._owner = owner
        self._output = Output()
        self.sock, theirs = open_channel()
        with theirs:
            self.pid = owner.start_worker(order, theirs.fileno(), self._output.fileno())
        self._life = posix.open_life(self.pid)
        self.plan: Plan | None = None
        self.room = Room(np.empty(0), np.empty((0, 0)), np.empty((0, 0)))
        self.awaits_test = False
        self.is_quick = False

    def prepare(self, plan: Plan) -> Reply:
        """Share memory for a plan with the worker, which then looks up the plan's variables."""
        size = max(Room.size(plan) * 8, 8)
        with posix.sealed_file(size) as file:
            self.room = Room.over(plan, _floats(file, size))
            send_request(self.sock, PREPARE, pickle.dumps(plan), (file.fileno(),))
        reply = self.receive(plan.time_limit + _GRACE_SECONDS)
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


class IsolatedFmu:
    """Simulates one FMU in a worker process, which is replaced when necessary."""

    def __init__(self, owner: Callable[[], Nursery], order: Order) -> None:
        self._owner, self._order = owner, order
        self._worker: _Worker | None = None
        self._has_loaded = False
        self._reuse: Reuse | None = None
        self._lock = threading.Lock()

    def simulate(
        self, plan: Plan, fill: Callable[[Room], None]
    ) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        """Simulate once.

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
            try:
                fill(worker.room)
                worker = self._started(worker, plan, fill)
                reply = worker.wait(plan.time_limit + _GRACE_SECONDS)
            except TimeoutError:
                raise self._end(
                    f"did not finish within the time limit of {plan.time_limit:g} s and was stopped",
                    "timeout",
                ) from None
            except Garbled:
                raise self._end("the FMU disturbed the replies of its process", "crashed") from None
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
                raise _error(reply, log)
            outputs = worker.room.outputs.copy()
            log = worker.take_log()
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
            self._await_test(self._worker, plan)
        worker = self._worker
        is_new = worker is None
        if worker is None:
            order = replace(self._order, reuse=self._reuse)
            worker = self._worker = _Worker(self._owner(), order)
        if worker.plan is plan or self._prepare(worker, plan, is_new=is_new):
            return worker
        return self._worker_for(plan)

    def _prepare(self, worker: _Worker, plan: Plan, *, is_new: bool) -> bool:
        """Prepare a worker; return False if an old one has died since its last simulation."""
        try:
            reply = worker.prepare(plan)
        except (Closed, TimeoutError) as error:
            if isinstance(error, Closed) and not is_new:
                self._drop()
                return False
            raise self._not_loaded(worker, error, plan.time_limit) from None
        except BaseException:
            self._drop()
            raise
        if reply.status != "ok":
            self._drop()
            text = f"{self._order.path}: {reply.text}"
            # What has loaded before is not unusable for that.
            raise SimulationError(text) if reply.status == "failed" and self._has_loaded else ModelError(text)
        self._has_loaded = True
        return True

    def _not_loaded(self, worker: _Worker, error: Exception, time_limit: float) -> Exception:
        """Error of an FMU that crashed or hung while it was loaded: unusable if it has never been loaded."""
        log = worker.take_log()
        code = self._drop()
        hangs = isinstance(error, TimeoutError)
        how = f"hung for {time_limit:g} s (time_limit)" if hangs else "crashed"
        text = f"{self._order.path}: the FMU {how} while it was loaded ({_how_it_ended(code)})" + "".join(
            f"\n  {line}" for line in log[-5:]
        )
        if not self._has_loaded:
            return ModelError(text)
        return SimulationError(text, status="timeout" if hangs else "crashed", log=log)

    def _await_test(self, worker: _Worker, plan: Plan) -> None:
        """Receive the result of the worker's reuse test; if it crashed or hung, never reuse a process."""
        worker.awaits_test = False
        try:
            reply = worker.receive(5 * plan.time_limit + _GRACE_SECONDS)
        except (Closed, TimeoutError):
            self._reuse = "process"
            self._drop()
            return
        except BaseException:
            self._drop()
            raise
        worker.take_log()
        self._reuse = cast(Reuse, reply.text) if reply.text in get_args(Reuse) else "process"
        if reply.leaving:
            self._drop()

    def _end(self, reason: str, status: FailureStatus) -> SimulationError:
        worker = self._worker
        assert worker is not None, "_end is called during a simulation"
        log = worker.take_log()
        code = self._drop()
        name = self._order.description.info.name
        reason = reason or f"the FMU's process crashed: {_how_it_ended(code)}"
        return SimulationError(f"{name}: {reason}" + _last_line(log), status=status, log=log)

    def _drop(self) -> int:
        worker, self._worker = self._worker, None
        return 0 if worker is None else worker.kill()


def _error(reply: Reply, log: tuple[str, ...]) -> SimulationError:
    time = None if reply.time < 0 else reply.time
    status: FailureStatus = "timeout" if reply.status == "timeout" else "failed"
    return SimulationError(reply.text + _last_line(log), status=status, time=time, log=log)


def _last_line(log: tuple[str, ...]) -> str:
    return f"; its last message: {log[-1]}" if log else ""


def _how_it_ended(code: int) -> str:
    if code >= 0:
        return f"it exited with code {code}"
    try:
        return f"signal {signal.Signals(-code).name}"
    except ValueError:
        return f"signal {-code}"


def _floats(file: IO[bytes], size: int) -> NDArray[np.float64]:
    return np.frombuffer(mmap.mmap(file.fileno(), size), dtype=np.float64)


class _Registry:
    """Nursery and workers of this process; a forked copy of the process starts without any."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._nursery: Nursery | None = None
        self._fmus: dict[tuple[str, str], IsolatedFmu] = {}
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
        key = (order.sha256, order.interface)
        found = self._fmus.get(key)
        if found is None:
            with self._lock:
                found = self._fmus.setdefault(key, IsolatedFmu(self.nursery, order))
        return found

    def drop(self, sha256: str, interface: str) -> None:
        with self._lock:
            found = self._fmus.pop((sha256, interface), None)
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
