"""Carries out the runs of a campaign in processes of this machine, some of which may die."""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from dataclasses import dataclass
from pathlib import Path

from falsifier.campaigns.directory import run_directory
from falsifier.errors import FalsifierError, JournalError
from falsifier.evaluation.workers import LastingExecutor, death
from falsifier.problem.problem import Problem
from falsifier.record.journal import STOP
from falsifier.record.run import StopFile, carry_out
from falsifier.search.request import RunRequest

# Maximum time in s between two ticks while runs are in progress.
_TICK = 0.25
# Time in s to wait for a run's lock: workers that died, and those of a killed campaign, take a moment to end.
PATIENCE = 10.0


@dataclass(frozen=True, slots=True)
class RunTask:
    """One run to carry out.

    What is searched is as it was when the campaign was started: its spec may change meanwhile.
    """

    name: str
    request: RunRequest
    problem: Problem
    hashes: dict[str, str]  # SHA-256 of its files, by path
    campaign: Path


Report = Callable[[RunTask, str], None]
Tick = Callable[[], bool]


def run_task(task: RunTask) -> None:
    """Carry out or resume one run, which writes a journal; JournalError if that cannot be written."""
    results = carry_out(
        task.request,
        [task.problem],
        run_directory(task.campaign, task.name),
        hashes=task.hashes,
        listeners=[StopFile(task.campaign / STOP, task.request.budget)],
        resume=True,
        patience=PATIENCE,
    )
    for result in results:
        if result.unrecorded and not result.falsified:
            raise JournalError(result.unrecorded)


class Schedule:
    """Gives runs to workers, which are pools of one process each, one at a time.

    A run whose process dies is tried once more, after the others: where memory is short, the system may have
    killed the process for what another one used.
    """

    def __init__(self, tasks: Iterable[RunTask], workers: Sequence[LastingExecutor]) -> None:
        self._waiting = deque(tasks)
        self._idle = list(workers)
        self._running: dict[Future[None], tuple[RunTask, LastingExecutor]] = {}
        self._lost: set[str] = set()

    def run(self, report: Report, tick: Tick) -> None:
        """Carry out all runs.

        Args:
            report: called with each run that has ended, and why it failed if its journal does not tell.
            tick: called several times per second; once it returns False, no more runs are started and those
                in progress are awaited.
        """
        proceed = tick()
        while self._running or (proceed and self._waiting):
            while proceed and self._waiting and self._idle:
                task, worker = self._waiting.popleft(), self._idle.pop()
                self._running[worker.submit(run_task, task)] = task, worker
            finished, _ = wait(self._running, timeout=_TICK, return_when=FIRST_COMPLETED)
            for future in finished:
                self._settle(future, report)
            proceed = tick() and proceed

    def _settle(self, future: Future[None], report: Report) -> None:
        task, worker = self._running.pop(future)
        self._idle.append(worker)
        match future.exception():
            case None:
                report(task, "")
            case BrokenExecutor() if task.name not in self._lost:
                self._lost.add(task.name)
                self._waiting.append(task)
            case BrokenExecutor() as error:
                report(task, death(error))
            case FalsifierError() as error:
                report(task, str(error))
            case error:
                report(task, f"{type(error).__name__}: {error}")
