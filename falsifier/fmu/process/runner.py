"""Simulation of one FMU or system in a worker, which is replaced if it crashes, hangs or leaks memory."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from falsifier.errors import ModelError, SimulationError
from falsifier.fmu.process import outcome
from falsifier.fmu.process.connection import Reply
from falsifier.fmu.process.order import Order
from falsifier.fmu.process.plan import Plan
from falsifier.fmu.process.worker import GRACE_SECONDS, REUSES, Reuse, Worker
from falsifier.fmu.process.workplace import Workplace

# Failures that are repeated to hear the FMU's messages, beside crashes after a reuse; more say the same.
_MAX_REPEATS = 3
# Longest wait for a trial of a way to start, in s and as a multiple of the first simulation's duration: one
# trial makes an instance and up to three simulations, on a machine that may be busy.
_LEAST_SECONDS, _DURATIONS = 1.0, 20.0


class Runner:
    """Simulates one FMU or system in a worker."""

    def __init__(self, workplace: Callable[[], Workplace], order: Order) -> None:
        self._workplace, self._order = workplace, order
        # How the next simulation starts, whichever process it runs in; None until that was tested.
        self.reuse: Reuse | None = None
        self.untrusted: tuple[Reuse, ...] = ()  # ways to start that made the FMU fail, crash or hang
        # The way that is being tested.
        self._trying: Reuse = "reset"
        # How long loading the FMU and its first simulation took at most.
        self._seconds = 0.0
        self._repeats = 0
        self._worker: Worker | None = None
        self._has_loaded = False
        self._lock = threading.Lock()
        self._is_stopped = False

    def simulate(self, plan: Plan, given: NDArray[np.float64]) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        """Simulate once.

        A crash in a process that has simulated before is repeated in a new one before it counts: the reuse
        may be to blame. If it is, the FMU's instances are not reused in this way any more. The repetition
        asks the FMU for messages, which most FMUs give only on request; for these, the first few other
        failures are repeated, too. ``given`` are the numbers of this simulation; see ``given_values``.

        Returns:
            The outputs, shape (outputs, samples), and the FMU's messages.

        Raises:
            SimulationError: if there is no complete trajectory.
            ModelError: if the FMU cannot be used.
        """
        with self._using():
            worker = self._worker_for(plan)
            is_reused, reuse = worker.simulations > 0, self.reuse
            try:
                return self._simulate(worker, plan, given)
            except SimulationError as error:
                if not self._should_repeat(error, is_reused=is_reused):
                    raise
                failure = error
            try:
                speaking = self._speaking_worker(plan)
            except (ModelError, SimulationError):
                raise failure from None
            repeated = self._simulate(speaking, plan, given)
            if is_reused:
                self._distrust(reuse or "instance")  # as after a first simulation too long to be repeated
            return repeated

    def load(self, plan: Plan) -> None:
        """Load the library and make an instance, without a simulation; ModelError if that fails."""
        with self._using():
            self._worker_for(plan)

    def close(self) -> None:
        """End the worker."""
        with self._lock:
            self._drop()

    def stop(self) -> None:
        """End the worker and, in whatever thread, a simulation under way; it fails there."""
        self._is_stopped = True
        worker = self._worker
        if worker is not None:
            worker.program.stop()
        self.close()

    def forget(self) -> None:
        """Leave the worker to another process, of which this is a copy."""
        if self._worker is not None:
            with contextlib.suppress(OSError):
                self._worker.program.forget()
            self._worker = None

    @contextmanager
    def _using(self) -> Iterator[None]:
        """Keep other threads away; end the worker after all that goes wrong, an interrupt too.

        Otherwise its reply would be mistaken for that of the next simulation.
        """
        with self._lock:
            try:
                yield
            except BaseException:
                self._drop()
                raise

    def _distrust(self, reuse: Reuse) -> None:
        """Never start in this way again, nor in a cheaper one; test the others."""
        self.untrusted = REUSES[: REUSES.index(reuse) + 1]
        self.reuse = "process" if reuse == "process" else None

    def _should_repeat(self, error: SimulationError, *, is_reused: bool) -> bool:
        if self._is_stopped or error.status == "timeout" or (self._order.logging and not is_reused):
            return False
        return (is_reused and error.status == "crashed") or self._is_worth_repeating()

    def _is_worth_repeating(self) -> bool:
        """Whether to repeat a failure in a new process for its messages; counts the repetitions."""
        self._repeats += 1
        return self._repeats <= _MAX_REPEATS

    def _speaking_worker(self, plan: Plan) -> Worker:
        """Return a new worker that asks the FMU for messages; it serves one simulation."""
        self._drop()
        worker = self._worker = Worker(self._workplace(), self._order, "process", (), logging=True)
        self._prepare(worker, plan)
        return worker

    def _simulate(
        self, worker: Worker, plan: Plan, given: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        self._check_wanted()  # it may have been stopped while the worker was being started
        try:
            reply = worker.simulate(plan, given)
        except (ConnectionError, TimeoutError) as error:
            outputs = worker.outputs(plan) if worker.is_complete else None
            if isinstance(error, TimeoutError):
                during = worker.during + worker.refusals
                failure = outcome.overdue(plan, worker.reached, during, worker.output.take())
            else:
                failure = outcome.crash(plan, worker.reached, *worker.crash(error))
            if outputs is None or worker.is_cut:
                raise failure from None
            self._drop()  # the FMU crashes or hangs when a simulation ends: all that it has to give is there
            return outputs, failure.log
        if not reply.is_done:
            log, refusals = worker.output.take(), worker.refusals
            raise outcome.failure(self._order.network, plan, reply, refusals, log)
        outputs = worker.outputs(plan)
        log = worker.output.take(reply.printed)
        if worker.simulations == 1:
            self._seconds = max(self._seconds, time.perf_counter() - worker.started)
        if reply.leaving:
            self._drop()
        return outputs, log

    def _check_wanted(self) -> None:
        if self._is_stopped:
            raise SimulationError("stopped, because its result is no longer needed")

    def _worker_for(self, plan: Plan) -> Worker:
        self._check_wanted()
        if self._worker is not None and self._worker.awaits_test:
            self._await_test(self._worker)
        if self._worker is not None and not self._worker.program.is_alive:  # since its last simulation
            self._drop()
        worker = self._worker
        if worker is not None and worker.plan and worker.plan is not plan and worker.plan.names - plan.names:
            self._drop()  # a reset that was tested with the same values may keep those that are set no more
            worker = None
        if worker is None:
            logging = self._order.logging
            worker = Worker(self._workplace(), self._order, self.reuse, self.untrusted, logging=logging)
            self._worker = worker
        if worker.plan is plan:
            return worker
        try:
            self._prepare(worker, plan)
        except ModelError:
            if worker.logging or not self._is_worth_repeating():
                raise
            # Once more, to hear why.
            return self._speaking_worker(plan)
        return worker

    def _prepare(self, worker: Worker, plan: Plan) -> None:
        limit = plan.time_limit + GRACE_SECONDS
        try:
            if worker.plan is None:
                self._check(worker, worker.load(limit), may_load_later=True)
            self._check(worker, worker.prepare(plan, limit), may_load_later=False)
        except (ConnectionError, TimeoutError) as error:
            raise self._not_loaded(worker, error, plan.time_limit) from None
        self._has_loaded = True

    def _check(self, worker: Worker, reply: Reply, *, may_load_later: bool) -> None:
        if reply.is_done:
            return
        name = self._order.network.stepped(reply.component)
        said = f"{name}: {reply.text}" if name else reply.text
        log = outcome.last_lines(worker.output.take())
        text = f"{self._order.network.name}: {said}{worker.refusals}{log}"
        # What has loaded before is not unusable for that.
        raise SimulationError(text) if may_load_later and self._has_loaded else ModelError(text)

    def _not_loaded(self, worker: Worker, error: Exception, time_limit: float) -> Exception:
        """Error of an FMU that crashed or hung while it was loaded: unusable if it has never been loaded."""
        hangs = isinstance(error, TimeoutError)
        if hangs:
            log = worker.output.take()
            reason = f"the FMU hung for {time_limit:g} s (time_limit) while it was loaded{worker.during}"
        else:
            what, details, log = worker.crash(error)
            reason = f"{what} while it was loaded{details}"
        text = f"{self._order.network.name}: {reason}{outcome.last_lines(log)}"
        if not self._has_loaded:
            return ModelError(text)
        return SimulationError(text, status="timeout" if hangs else "crashed", log=log)

    def _await_test(self, worker: Worker) -> None:
        """Receive the result of the worker's reuse test; what crashed or hung is not tried again."""
        worker.awaits_test = False
        patience = _LEAST_SECONDS + _DURATIONS * self._seconds
        try:
            reply = worker.receive(patience)
            while reply.more:
                self._trying = _reuse(reply)
                reply = worker.receive(patience)
        except (ConnectionError, TimeoutError):
            self._distrust(self._trying)
            self._drop()
            return
        worker.output.take()
        self.reuse = _reuse(reply)
        if reply.leaving or self.reuse == "process":
            self._drop()

    def _drop(self) -> None:
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.end()


def _reuse(reply: Reply) -> Reuse:
    """Read a kind of reuse from the reply of a process that may send anything."""
    return reply.text if reply.text in REUSES else "process"
