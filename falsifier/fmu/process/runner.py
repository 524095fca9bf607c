"""Simulation of one FMU or system in a worker, which is replaced if it crashes, hangs or leaks memory."""

import threading
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from falsifier.errors import ModelError, SimulationError
from falsifier.fmu.process import outcome
from falsifier.fmu.process.connection import Closed, Reply
from falsifier.fmu.process.order import Order
from falsifier.fmu.process.plan import Plan
from falsifier.fmu.process.worker import GRACE_SECONDS, REUSES, Reuse, Worker
from falsifier.fmu.process.workplace import Workplace

# Failures of simulations in new processes that are repeated to hear the FMU's messages; more say the same.
_MAX_REPEATS = 3
# Longest wait for a trial of a way to start, in s and as a multiple of the first simulation's duration: one
# trial makes an instance and two simulations, on a machine that may be busy.
_LEAST_SECONDS, _DURATIONS = 1.0, 20.0


class Experience:
    """What is known of one FMU, whichever process it runs in.

    Attributes:
        reuse: how the next simulation starts; None until that was tested.
        untrusted: ways that made the FMU crash or hang.
        trying: the way that is being tested.
    """

    def __init__(self) -> None:
        self.reuse: Reuse | None = None
        self.untrusted: tuple[Reuse, ...] = ()
        self.trying: Reuse = "reset"
        self._repeats = 0
        self._seconds = 0.0

    def took(self, seconds: float) -> None:
        """Remember how long loading the FMU and its first simulation took."""
        self._seconds = max(self._seconds, seconds)

    @property
    def patience(self) -> float:
        """How long to wait for a trial, in s."""
        return _LEAST_SECONDS + _DURATIONS * self._seconds

    def distrust(self, reuse: Reuse) -> None:
        """Never start in this way again, nor in a cheaper one; test the others."""
        self.untrusted = REUSES[: REUSES.index(reuse) + 1]
        self.reuse = "process" if reuse == "process" else None

    def is_worth_repeating(self) -> bool:
        """Whether to repeat a failure in a new process for its messages; counts the repetitions."""
        self._repeats += 1
        return self._repeats <= _MAX_REPEATS


class Runner:
    """Simulates one FMU or system in a worker.

    Args:
        workplace: returns the folder of all workers.
        order: what to simulate.
    """

    def __init__(self, workplace: Callable[[], Workplace], order: Order) -> None:
        self._workplace, self._order = workplace, order
        self._worker: Worker | None = None
        self._has_loaded = False
        self._experience = Experience()
        self._lock = threading.Lock()
        self._is_stopped = False

    def simulate(self, plan: Plan, given: NDArray[np.float64]) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        """Simulate once.

        A simulation that fails in a process that has simulated before is repeated in a new one before it
        counts as failed: the reuse may be to blame. If it is, the FMU's instances are not reused any more.
        The repetition asks the FMU for messages, which most FMUs give only on request.

        Args:
            plan: what the simulations have in common.
            given: the numbers of this one; see ``given_values``.

        Returns:
            The outputs, shape (outputs, samples), and the FMU's messages.

        Raises:
            SimulationError: if there is no complete trajectory.
            ModelError: if the FMU cannot be used.
        """
        with self._lock:
            worker = self._worker_for(plan)
            is_reused, reuse = worker.simulations > 0, self._experience.reuse
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
            if is_reused and reuse is not None:
                self._experience.distrust(reuse)
            return repeated

    def load(self, plan: Plan) -> None:
        """Load the library and make an instance, without a simulation.

        Raises:
            ModelError: if that fails.
        """
        with self._lock:
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
            worker.stop()
        self.close()

    def forget(self) -> None:
        """Leave the worker to another process, of which this is a copy."""
        if self._worker is not None:
            self._worker.forget()
            self._worker = None

    def _should_repeat(self, error: SimulationError, *, is_reused: bool) -> bool:
        if self._is_stopped or error.status == "timeout" or (self._order.logging and not is_reused):
            return False
        return (is_reused and error.status == "crashed") or self._experience.is_worth_repeating()

    def _speaking_worker(self, plan: Plan) -> Worker:
        """Return a new worker that asks the FMU for messages; it serves one simulation."""
        self._drop()
        worker = self._worker = Worker(self._workplace(), self._order, "process", (), logging=True)
        self._prepare(worker, plan, is_new=True)
        return worker

    def _simulate(
        self, worker: Worker, plan: Plan, given: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        self._check_wanted()  # it may have been stopped while the worker was being started
        try:
            worker.start(given)
            reply = worker.wait()
        except TimeoutError:
            reached, during, log = worker.reached, worker.during + worker.refusals, worker.take_log()
            self._drop()
            raise outcome.overdue(plan, reached, during, log) from None
        except Closed as error:
            reason, log = worker.crash(error)
            self._worker = None
            raise outcome.crash(plan, reason, log) from None
        except BaseException:
            # Interrupted: otherwise its reply would be mistaken for that of the next simulation.
            self._drop()
            raise
        if not reply.is_done:
            log, refusals = worker.take_log(), worker.refusals
            self._drop()
            raise outcome.failure(self._order.network, plan, reply, refusals, log)
        outputs = worker.outputs(plan)
        log = worker.take_log(reply)
        if worker.simulations == 1:
            self._experience.took(time.perf_counter() - worker.started)
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
        if self._worker is not None and not self._worker.is_alive:  # it has died since its last simulation
            self._drop()
        worker, known = self._worker, self._experience
        is_new = worker is None
        if worker is None:
            worker = self._worker = Worker(
                self._workplace(), self._order, known.reuse, known.untrusted, logging=self._order.logging
            )
        if worker.plan is plan:
            return worker
        try:
            self._prepare(worker, plan, is_new=is_new)
        except ModelError:
            if worker.logging or not known.is_worth_repeating():
                raise
            # Once more, to hear why.
            return self._speaking_worker(plan)
        return worker

    def _prepare(self, worker: Worker, plan: Plan, *, is_new: bool) -> None:
        limit = plan.time_limit + GRACE_SECONDS
        try:
            if is_new:
                self._check(worker, worker.load(limit), may_load_later=True)
            self._check(worker, worker.prepare(plan, limit), may_load_later=False)
        except (Closed, TimeoutError) as error:
            raise self._not_loaded(worker, error, plan.time_limit) from None
        except BaseException:
            self._drop()
            raise
        self._has_loaded = True

    def _check(self, worker: Worker, reply: Reply, *, may_load_later: bool) -> None:
        if reply.is_done:
            return
        name = self._order.network.stepped(reply.component)
        said = f"{name}: {reply.text}" if name else reply.text
        text = f"{self._order.network.name}: {said}{worker.refusals}{outcome.last_lines(worker.take_log())}"
        # What has loaded before is not unusable for that.
        raise SimulationError(text) if may_load_later and self._has_loaded else ModelError(text)

    def _not_loaded(self, worker: Worker, error: Exception, time_limit: float) -> Exception:
        """Error of an FMU that crashed or hung while it was loaded: unusable if it has never been loaded."""
        if isinstance(error, TimeoutError):
            during, log = worker.during, worker.take_log()
            self._drop()
            reason = f"the FMU hung for {time_limit:g} s (time_limit) while it was loaded{during}"
        else:
            said, log = worker.crash(error)
            self._worker = None
            how, _, end = said.partition(": ")
            reason = f"{how} while it was loaded{f' ({end})' if end else ''}"
        text = f"{self._order.network.name}: {reason}{outcome.last_lines(log)}"
        if not self._has_loaded:
            return ModelError(text)
        hangs = isinstance(error, TimeoutError)
        return SimulationError(text, status="timeout" if hangs else "crashed", log=log)

    def _await_test(self, worker: Worker) -> None:
        """Receive the result of the worker's reuse test; what crashed or hung is not tried again."""
        worker.awaits_test = False
        known = self._experience
        try:
            reply = worker.receive(known.patience)
            while reply.more:
                known.trying = _reuse(reply)
                reply = worker.receive(known.patience)
        except (Closed, TimeoutError):
            known.distrust(known.trying)
            self._drop()
            return
        except BaseException:
            self._drop()
            raise
        worker.take_log()
        known.reuse = _reuse(reply)
        if reply.leaving or known.reuse == "process":
            self._drop()

    def _drop(self) -> None:
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.end()


def _reuse(reply: Reply) -> Reuse:
    """Read a kind of reuse from the reply of a process that may send anything."""
    return reply.text if reply.text in REUSES else "process"
