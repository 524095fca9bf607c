"""Keeps an executor busy with runs, even if its workers die."""

import logging
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from time import monotonic

from falsifier.campaigns.worker import Done, Missing, RunTask, fmu_file, run_task
from falsifier.errors import FalsifierError
from falsifier.evaluation.workers import Workers

_LOG = logging.getLogger(__name__)

# Maximum time in s between two ticks while runs are in progress.
_TICK = 0.25
# Time in s without any worker after which that is reported: a cluster needs a moment to replace one.
_ALONE_SECONDS = 20.0

Report = Callable[[RunTask, Done], None]
Tick = Callable[[], bool]


class Schedule:
    """Assigns runs to workers and finds out which run killed a worker.

    If a worker process dies, the whole pool is lost, so every run in progress is a suspect. Suspects are
    repeated one at a time; a run that kills its worker while running alone has failed.

    Args:
        tasks: runs to carry out.
        workers: the pool.
        calls: maximum number of concurrent runs that use a language model.
    """

    def __init__(self, tasks: Iterable[RunTask], workers: Workers, *, calls: int) -> None:
        self._workers = workers
        self._calls = calls
        self._waiting = deque(tasks)
        self._suspects: deque[RunTask] = deque()
        self._running: dict[Future[Done | Missing], RunTask] = {}
        self._served = monotonic()
        self._is_reported = False

    def run(self, report: Report, tick: Tick) -> None:
        """Carry out all runs.

        Args:
            report: called with each run that has ended.
            tick: called several times per second; once it returns False, no more runs are started and those
                in progress are awaited, as long as there are workers.
        """
        proceed = tick()
        while self._running or (proceed and (self._waiting or self._suspects)):
            is_served = self._check_served()
            if not (proceed or is_served):
                self._workers.shutdown(wait=False, cancel_futures=True)
                self._running.clear()
                return
            if proceed:
                self._submit()
            finished, _ = wait(self._running, timeout=_TICK, return_when=FIRST_COMPLETED)
            for future in finished:
                self._settle(future, report)
            proceed = tick() and proceed

    def _check_served(self) -> bool:
        """Return whether there are workers; report once if there have been none for long.

        Dask gives up workers that take long to restart.
        """
        is_served = self._workers.slots() > 0
        if is_served:
            self._served, self._is_reported = monotonic(), False
        elif not self._is_reported and monotonic() - self._served >= _ALONE_SECONDS:
            self._is_reported = True
            _LOG.warning(
                "the cluster has no workers; the campaign goes on as soon as one joins. Ctrl-C stops it, and "
                "falsifier resume goes on later"
            )
        return is_served

    def _submit(self) -> None:
        if self._suspects:  # alone, so that a dead worker identifies its run
            if not self._running:
                self._start(self._suspects.popleft())
            return
        while self._waiting and len(self._running) < self._workers.slots():
            task = self._next()
            if task is None:
                return
            self._start(task)

    def _next(self) -> RunTask | None:
        """First waiting run that the limit on runs with a language model allows."""
        asking = sum(task.request.llm is not None for task in self._running.values())
        for task in self._waiting:
            if task.request.llm is None or asking < self._calls:
                self._waiting.remove(task)
                return task
        return None

    def _start(self, task: RunTask, files: dict[str, bytes] | None = None) -> None:
        self._running[self._workers.submit(run_task, task, files or {})] = task

    def _settle(self, future: Future[Done | Missing], report: Report) -> None:
        task = self._running.pop(future, None)
        if task is None:  # already handled when the pool was restarted
            return
        try:
            outcome = future.result()
        except (BrokenExecutor, CancelledError) as error:
            self._recover(task, str(error), report)
        except FalsifierError as error:
            report(task, Done("failed", str(error)))
        except Exception as error:
            report(task, Done("failed", f"{type(error).__name__}: {error}"))
        else:
            if isinstance(outcome, Missing):
                path = fmu_file(task.problem, outcome.digest)
                self._start(task, {outcome.digest: path.read_bytes()})
            else:
                report(task, outcome)

    def _recover(self, task: RunTask, reason: str, report: Report) -> None:
        """Restart the pool after a worker died; report the run if it was alone, otherwise suspect all."""
        alone = not self._running
        others = list(self._running.values())
        self._running.clear()
        self._workers.restart()
        if alone:
            report(task, Done("failed", f"its worker process died: {reason}"))
        else:
            self._suspects.extend([task, *others])
