"""Keep an executor busy with runs, whatever becomes of its workers."""

from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait

from falsifier.campaigns.work import Done, Missing, Task, fmu_file, run_task
from falsifier.errors import FalsifierError
from falsifier.evaluation.workers import Workers

# Longest time in s between two looks at the campaign while runs go on.
_TICK = 0.25

Report = Callable[[Task, Done], None]
Tick = Callable[[], bool]


class Schedule:
    """Which runs wait, which are with a worker, and which are under suspicion.

    When a worker process dies, all runs that were with workers are suspects: they go on one at a time, and
    one that kills its worker when it is alone has failed.

    Args:
        tasks: runs to do.
        workers: who does them.
        calls: most runs with a language model at a time.
    """

    def __init__(self, tasks: Iterable[Task], workers: Workers, *, calls: int) -> None:
        self._workers = workers
        self._calls = calls
        self._waiting = deque(tasks)
        self._suspects: deque[Task] = deque()
        self._running: dict[Future[Done | Missing], Task] = {}

    def run(self, report: Report, tick: Tick) -> None:
        """Do all runs.

        Args:
            report: called with each run that has ended.
            tick: called every moment; False: start nothing more, and wait for what runs.
        """
        proceed = tick()
        while self._running or (proceed and (self._waiting or self._suspects)):
            if proceed:
                self._submit()
            finished, _ = wait(self._running, timeout=_TICK, return_when=FIRST_COMPLETED)
            for future in finished:
                self._settle(future, report)
            proceed = tick() and proceed

    def _submit(self) -> None:
        if self._suspects:
            if not self._running:
                self._start(self._suspects.popleft())
            return
        while self._waiting and len(self._running) < self._workers.slots():
            task = self._next()
            if task is None:
                return
            self._start(task)

    def _next(self) -> Task | None:
        """First waiting run that the limit on language models allows."""
        asking = sum(task.request.llm is not None for task in self._running.values())
        for task in self._waiting:
            if task.request.llm is None or asking < self._calls:
                self._waiting.remove(task)
                return task
        return None

    def _start(self, task: Task, files: dict[str, bytes] | None = None) -> None:
        try:
            self._running[self._workers.executor.submit(run_task, task, files or {})] = task
        except BrokenExecutor:  # a worker died while nothing ran
            self._workers.restart()
            self._running[self._workers.executor.submit(run_task, task, files or {})] = task

    def _settle(self, future: Future[Done | Missing], report: Report) -> None:
        task = self._running.pop(future, None)
        if task is None:  # withdrawn together with others
            return
        try:
            outcome = future.result()
        except (BrokenExecutor, CancelledError) as error:
            self._mourn(task, str(error), report)
        except FalsifierError as error:
            report(task, Done("failed", str(error)))
        except Exception as error:
            report(task, Done("failed", f"{type(error).__name__}: {error}"))
        else:
            if isinstance(outcome, Missing):
                path = fmu_file(task.problem)
                assert path is not None
                self._start(task, {outcome.digest: path.read_bytes()})
            else:
                report(task, outcome)

    def _mourn(self, task: Task, reason: str, report: Report) -> None:
        """A worker died: start new ones, and find out which run it was."""
        alone = not self._running
        others = list(self._running.values())
        self._running.clear()
        self._workers.restart()
        if alone:
            report(task, Done("failed", f"its worker process died: {reason}"))
        else:
            self._suspects.extend([task, *others])
