"""Executors for evaluations: this process, local processes or a Dask cluster."""

import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from falsifier.core import operating_system
from falsifier.core.candidate import Candidate
from falsifier.errors import SpecError
from falsifier.evaluation.cluster import connected
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

# Logger of the package that simulates FMUs; workers get the parent's level for it.
_FMU_LOGGER = "falsifier.fmu"


@contextmanager
def local_executor(jobs: int) -> Iterator[Executor | None]:
    """Open an executor with this many local processes; None for one job, which runs in this process.

    Raises:
        SpecError: if jobs is not positive.
    """
    _check_jobs(jobs)
    if jobs == 1:
        yield None
        return
    with _process_pool(jobs) as executor:
        yield executor


@dataclass(slots=True)
class Workers:
    """An executor that can be replaced if its workers have died.

    Attributes:
        executor: the current executor.
        slots: returns the number of tasks that can currently run at the same time.
        make: creates another executor.
    """

    executor: Executor
    slots: Callable[[], int]
    make: Callable[[], Executor]

    def restart(self) -> None:
        """Replace the executor; its unfinished tasks are lost."""
        self.executor.shutdown(wait=False, cancel_futures=True)
        self.executor = self.make()


@contextmanager
def open_workers(jobs: int, cluster: str | None = None) -> Iterator[Workers]:
    """Open local worker processes, or connect to those of a cluster.

    Args:
        jobs: number of local processes; not used with a cluster.
        cluster: ``dask:tcp://HOST:PORT``, the address of a Dask scheduler.

    Raises:
        SpecError: if the cluster is not a Dask address, or Dask is not installed.
        ModelError: if the scheduler cannot be reached.
    """
    if cluster is not None:
        with connected(cluster) as executor:

            def again() -> Executor:
                executor.check()
                return executor

            yield Workers(executor, executor.slots, again)
        return
    _check_jobs(jobs)
    workers = Workers(_process_pool(jobs), lambda: jobs, lambda: _process_pool(jobs))
    try:
        yield workers
    finally:
        workers.executor.shutdown(cancel_futures=True)


def evaluate_all(
    problem: Problem, candidates: Sequence[Candidate], executor: Executor | None
) -> Iterator[Evaluation]:
    """Yield the evaluations in the order of the candidates, each as soon as it and those before it are done.

    If a worker process dies, its evaluation has the status ``crashed``.
    """
    if executor is None:
        yield from (evaluate(problem, candidate) for candidate in candidates)
        return
    futures = [executor.submit(evaluate, problem, candidate) for candidate in candidates]
    for candidate, future in zip(candidates, futures, strict=True):
        try:
            yield future.result()
        except BrokenExecutor as error:
            yield Evaluation(candidate, "crashed", reason=f"the worker process died: {error}")


def _check_jobs(jobs: int) -> None:
    if jobs < 1:
        raise SpecError(f"jobs must be at least 1, got {jobs}")


def _process_pool(jobs: int) -> "ProcessPoolExecutor":
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    operating_system.start_silent_tracker()
    level = logging.getLogger(_FMU_LOGGER).level
    return ProcessPoolExecutor(
        jobs, mp_context=get_context("spawn"), initializer=_prepare_worker, initargs=(level,)
    )


def _prepare_worker(log_level: int) -> None:
    """Make a worker end with its parent, however that ends, and ignore Ctrl-C, which the parent handles.

    Args:
        log_level: the parent's level of the logger for simulations.
    """
    import os
    import signal
    from multiprocessing import parent_process
    from threading import Thread

    logging.getLogger(_FMU_LOGGER).setLevel(log_level)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is None:
        return

    def follow() -> None:
        parent.join()
        os._exit(1)

    Thread(target=follow, daemon=True).start()
