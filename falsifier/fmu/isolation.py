"""Simulation in worker processes: the side of the process that requests it.

Each requesting process has one starter of workers, and one worker per FMU, interface and thread; when another
is needed, those of ended threads and the oldest of a thread that has many are ended. A worker that crashes,
hangs or leaks memory is replaced; the simulation that it was running raises a SimulationError.
"""

import atexit
import contextlib
import threading
import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from falsifier.core import operating_system
from falsifier.core.operating_system import exit_text
from falsifier.errors import FailureStatus, ModelError, SimulationError
from falsifier.fmu import process
from falsifier.fmu.buffers import Room
from falsifier.fmu.channel import (
    Closed,
    Garbled,
    Reply,
    send_request,
)
from falsifier.fmu.failure_text import last_lines, simulation_error
from falsifier.fmu.plan import Plan
from falsifier.fmu.processes import GRACE_SECONDS, WorkerProcess
from falsifier.fmu.starting import Starter
from falsifier.fmu.trust import Trust
from falsifier.fmu.ways import open_starter
from falsifier.fmu.worker import RUN
from falsifier.fmu.worker_order import REUSES, Order, Reuse

# A thread simulates with one worker at a time; the others save the start if it returns to their FMUs.
_MOST_OF_A_THREAD = 12


class IsolatedFmu:
    """Simulates one FMU in a worker process, which is replaced when necessary."""

    def __init__(self, owner: Callable[[], Starter], order: Order) -> None:
        self._owner, self._order = owner, order
        self._worker: WorkerProcess | None = None
        self._has_loaded = False
        self._trust = Trust()
        self._lock = threading.Lock()
        self._is_stopped = False

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
                failure = error
            try:
                speaking = self._speaking_worker(plan)
            except (ModelError, SimulationError):
                raise failure from None
            repeated = self._simulate(speaking, plan, fill)
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
        if self._is_stopped or error.status == "timeout" or (self._order.logging and not is_reused):
            return False
        return (is_reused and error.status == "crashed") or self._trust.is_worth_repeating()

    def _speaking_worker(self, plan: Plan) -> WorkerProcess:
        """Return a new worker that asks the FMU for messages; it serves one simulation."""
        self._drop()
        order = replace(self._order, logging=True, reuse="process")
        worker = self._worker = WorkerProcess(self._owner(), order)
        self._prepare(worker, plan, is_new=True)
        return worker

    def _simulate(
        self, worker: WorkerProcess, plan: Plan, fill: Callable[[Room], None]
    ) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        try:
            fill(worker.room)
            worker = self._started(worker, plan, fill)
            reply = worker.wait(plan.time_limit + GRACE_SECONDS)
        except TimeoutError:
            during = self._during(worker)
            raise self._end(
                f"did not finish within the time limit of {plan.time_limit:g} s and was stopped{during}; "
                "slow models need a larger time_limit",
                "timeout",
            ) from None
        except Garbled:
            disturbed = f"the FMU disturbed the replies of its process{self._during(worker)}"
            raise self._end(disturbed, "crashed") from None
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

    def stop(self) -> None:
        """End the worker and, in whatever thread, a simulation under way; it fails there."""
        self._is_stopped = True
        worker = self._worker
        if worker is not None:
            worker.hang_up()
        self.close()

    def forget(self) -> None:
        """Close the connection in a forked copy of this process; the worker belongs to the original."""
        if self._worker is not None:
            self._worker.sock.close()
            self._worker = None

    def _started(self, worker: WorkerProcess, plan: Plan, fill: Callable[[Room], None]) -> WorkerProcess:
        """Start the simulation, in a new worker if this one has died since its last simulation."""
        self._check_wanted()  # it may have been stopped while the worker was being started
        try:
            send_request(worker.sock, RUN)
        except Closed:
            self._drop()
            worker = self._worker_for(plan)
            fill(worker.room)
            send_request(worker.sock, RUN)
        return worker

    def _check_wanted(self) -> None:
        if self._is_stopped:
            raise SimulationError("stopped, because its result is no longer needed")

    def _worker_for(self, plan: Plan) -> WorkerProcess:
        self._check_wanted()
        if self._worker is not None and self._worker.awaits_test:
            self._await_test(self._worker)
        worker = self._worker
        is_new = worker is None
        if worker is None:
            trust = self._trust
            order = replace(self._order, reuse=trust.reuse, untrusted=trust.untrusted)
            worker = self._worker = WorkerProcess(self._owner(), order)
        if worker.plan is plan:
            return worker
        try:
            is_prepared = self._prepare(worker, plan, is_new=is_new)
        except ModelError:
            if worker.logging or not self._trust.is_worth_repeating():
                raise
            # Once more, to hear why.
            return self._speaking_worker(plan)
        return worker if is_prepared else self._worker_for(plan)

    def _prepare(self, worker: WorkerProcess, plan: Plan, *, is_new: bool) -> bool:
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
            log = worker.take_log()
            self._drop()
            text = f"{self._order.path}: {reply.text}{last_lines(log)}"
            # What has loaded before is not unusable for that.
            raise SimulationError(text) if reply.status == "failed" and self._has_loaded else ModelError(text)
        self._has_loaded = True
        return True

    def _not_loaded(self, worker: WorkerProcess, error: Exception, time_limit: float) -> Exception:
        """Error of an FMU that crashed or hung while it was loaded: unusable if it has never been loaded."""
        log, during = worker.take_log(), self._during(worker)
        code = self._drop()
        hangs = isinstance(error, TimeoutError)
        how = f"hung for {time_limit:g} s (time_limit)" if hangs else "crashed"
        end = f"({exit_text(code)}){last_lines(log)}"
        text = f"{self._order.path}: the FMU {how} while it was loaded{during} {end}"
        if not self._has_loaded:
            return ModelError(text)
        return SimulationError(text, status="timeout" if hangs else "crashed", log=log)

    def _await_test(self, worker: WorkerProcess) -> None:
        """Receive the result of the worker's reuse test; what crashed or hung is not tried again."""
        worker.awaits_test = False
        trust = self._trust
        try:
            reply = worker.receive(trust.patience)
            while reply.more:
                trust.trying = _reuse(reply)
                reply = worker.receive(trust.patience)
        except (Closed, TimeoutError):
            trust.distrust(trust.trying)
            self._drop()
            return
        except BaseException:
            self._drop()
            raise
        worker.take_log()
        trust.reuse = _reuse(reply)
        if reply.leaving:
            self._drop()

    def _end(self, reason: str, status: FailureStatus) -> SimulationError:
        worker = self._worker
        assert worker is not None, "_end is called during a simulation"
        log, during = worker.take_log(), self._during(worker)
        code = self._drop()
        name = self._order.description.info.name
        reason = reason or f"the FMU's process crashed{during}: {exit_text(code)}"
        return SimulationError(f"{name}: {reason}" + last_lines(log), status=status, log=log)

    def _during(self, worker: WorkerProcess) -> str:
        """Say which component of a system was running; nothing for a single FMU."""
        network = self._order.network
        # The worker may have written anything there.
        position = worker.room.component[0]
        name = network.stepped(position) if network is not None and np.isfinite(position) else ""
        return f" in component {name}" if name else ""

    def _drop(self) -> int:
        worker, self._worker = self._worker, None
        return 0 if worker is None else worker.kill()


def _reuse(reply: Reply) -> Reuse:
    """Read a kind of reuse from the reply of a process that may send anything."""
    return reply.text if reply.text in REUSES else "process"


class _Registry:
    """What starts this process's workers, and these; a forked copy of the process starts without any."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._starter: Starter | None = None
        self._fmus: dict[tuple[str, str, bool, bool, int], IsolatedFmu] = {}
        atexit.register(self.close)
        operating_system.on_fork(self.forget)

    def starter(self) -> Starter:
        with self._lock:
            if self._starter is not None and not self._starter.is_alive:
                self._starter.close()
                self._starter = None
            if self._starter is None:
                self._starter = open_starter()
            return self._starter

    def fmu(self, order: Order) -> IsolatedFmu:
        # Not get_ident: threads of other libraries are listed only once they have asked for themselves.
        thread = threading.current_thread().ident or 0
        key = (order.sha256, order.interface, order.logging, order.through_wine, thread)
        found = self._fmus.get(key)
        if found is None:
            with self._lock:
                superfluous = self._take_superfluous(thread)
                found = self._fmus[key] = IsolatedFmu(self.starter, order)
            _close(superfluous)
        return found

    def _take_superfluous(self, thread: int) -> list[IsolatedFmu]:
        """Take out what ended threads have left, and the oldest of a thread that needs one more."""
        alive = {each.ident for each in threading.enumerate()}
        keys = [key for key in self._fmus if key[-1] not in alive]
        own = [key for key in self._fmus if key[-1] == thread]
        keys += own[: max(0, len(own) + 1 - _MOST_OF_A_THREAD)]
        return [self._fmus.pop(key) for key in keys]

    def drop(self, sha256: str, interface: str, *, logging: bool = False, through_wine: bool = False) -> None:
        with self._lock:
            keys = [key for key in self._fmus if key[:-1] == (sha256, interface, logging, through_wine)]
            found = [self._fmus.pop(key) for key in keys]
        for fmu in found:
            fmu.close()

    def stop(self, threads: Collection[int]) -> None:
        with self._lock:
            keys = [key for key in self._fmus if key[-1] in threads]
            found = [self._fmus.pop(key) for key in keys]
        for fmu in found:
            fmu.stop()

    def close(self) -> None:
        with self._lock:
            fmus, self._fmus = self._fmus, {}
            owner, self._starter = self._starter, None
        _close(fmus.values())
        if owner is not None:
            owner.close()

    def forget(self) -> None:
        self._lock = threading.Lock()
        for fmu in self._fmus.values():
            fmu.forget()
        if self._starter is not None:
            self._starter.forget()
        self._fmus, self._starter = {}, None


def _close(fmus: Iterable[IsolatedFmu]) -> None:
    for fmu in fmus:
        with contextlib.suppress(ModelError):
            fmu.close()


REGISTRY = _Registry()


def stop_simulations(threads: Collection[int]) -> None:
    """End the workers of threads of this process, also in the middle of a simulation.

    Args:
        threads: their identifiers (threading.get_ident); they start no other simulation.
    """
    REGISTRY.stop(threads)
    process.REGISTRY.stop(threads)
