"""Executors for evaluations: this process, local processes or a Dask cluster."""

import logging
import sys
from collections.abc import Awaitable, Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from threading import get_ident
from typing import TYPE_CHECKING, Any, TypeVar

from falsifier.core.candidate import Candidate
from falsifier.core.model import Model
from falsifier.core.secrets import holds_credentials
from falsifier.errors import ModelError, SpecError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

T = TypeVar("T")
# One end of a Pipe, whose class differs between systems, or None.
_End = Any

# Logger of the package that simulates FMUs; workers get the parent's level for it.
_FMU_LOGGER = "falsifier.fmu"
# Maximum time in s to wait for a cluster's scheduler.
_CONNECT_TIMEOUT = 20
# Filter in the format of python -W: warnings whose message starts with this word.
_TRACKER_FILTER = "ignore:resource_tracker"


class Workers(Executor):
    """An executor that makes another one if the processes of the present one have died.

    Args:
        make: makes an executor.
        slots: returns the number of tasks that can currently run at the same time.
    """

    def __init__(self, make: Callable[[], Executor], slots: Callable[[], int]) -> None:
        self._make, self.slots = make, slots
        self._executor = make()
        self._futures: set[Future[Any]] = set()

    def is_busy(self) -> bool:
        """Whether a task is being carried out; what waits for a process is cancelled."""
        return any(not (future.cancel() or future.done()) for future in list(self._futures))

    def restart(self) -> None:
        """Replace the present executor; its unfinished tasks are lost."""
        self._executor.shutdown(wait=False, cancel_futures=True)
        self._executor = self._make()

    def submit(self, function: Callable[..., T], /, *args: Any, **options: Any) -> "Future[T]":
        """Start a task."""
        try:
            future = self._executor.submit(function, *args, **options)
        except BrokenExecutor:
            self.restart()
            future = self._executor.submit(function, *args, **options)
        self._futures.add(future)
        future.add_done_callback(self._futures.discard)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: FBT001, FBT002 - as in the base class
        """End the present executor."""
        self._executor.shutdown(wait, cancel_futures=cancel_futures)


@contextmanager
def local_executor(jobs: int, model: Model) -> Iterator[Executor | None]:
    """Open an executor for so many simulations of a model at a time; None for one, in this thread.

    A model that simulates in processes of its own needs only threads, each with its own such process: other
    Python processes would take seconds to start. They are there for models in Python. Simulations that are
    still under way at the end are stopped.
    """
    if jobs == 1:
        yield None
        return
    with _threads(jobs) if getattr(model, "has_own_processes", False) else _processes(jobs) as executor:
        yield executor


@contextmanager
def _threads(jobs: int) -> Iterator[Executor]:
    from falsifier.fmu import stop_simulations

    started: list[int] = []
    executor = ThreadPoolExecutor(jobs, initializer=lambda: started.append(get_ident()))
    try:
        yield executor
    finally:
        executor.shutdown(wait=False, cancel_futures=True)
        stop_simulations(started)
        executor.shutdown()


@contextmanager
def _processes(jobs: int) -> Iterator[Executor]:
    from multiprocessing import Pipe

    ending, end = Pipe(duplex=False)
    executor = Workers(lambda: _process_pool(jobs, ending), lambda: jobs)
    try:
        yield executor
    finally:
        if executor.is_busy():
            end.close()
        executor.shutdown(cancel_futures=True)
        end.close()
        ending.close()


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

            yield Workers(again, executor.slots)
        return
    if jobs < 1:
        raise SpecError(f"jobs must be at least 1, got {jobs}")
    workers = Workers(lambda: _process_pool(jobs), lambda: jobs)
    try:
        yield workers
    finally:
        workers.shutdown(cancel_futures=True)


def start(
    problem: Problem, candidates: Sequence[Candidate], executor: Executor | None
) -> list[Callable[[], Evaluation]]:
    """Start to simulate candidates; return functions that wait for their evaluations, in order.

    Without an executor, a function simulates when it is called. A pool of processes is lost with the first
    that dies, so its simulations are repeated one at a time, each in a process of its own; the one that ends
    that process too has the status ``crashed``.
    """
    if executor is None:
        return [partial(evaluate, problem, candidate) for candidate in candidates]
    return [partial(_wait, problem, c, executor.submit(evaluate, problem, c)) for c in candidates]


def _wait(problem: Problem, candidate: Candidate, future: "Future[Evaluation]") -> Evaluation:
    with suppress(BrokenExecutor):
        return future.result()
    with _processes(1) as alone:
        try:
            return alone.submit(evaluate, problem, candidate).result()
        except BrokenExecutor as error:
            return Evaluation(candidate, "crashed", reason=f"the worker process died: {error}")


def _process_pool(jobs: int, ending: _End = None) -> "ProcessPoolExecutor":
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    _start_silent_tracker()
    level = logging.getLogger(_FMU_LOGGER).level
    return ProcessPoolExecutor(
        jobs, mp_context=get_context("spawn"), initializer=_prepare_worker, initargs=(level, ending)
    )


def _start_silent_tracker() -> None:
    """Start multiprocessing's resource tracker, which frees a pool's semaphores, without its warnings.

    It still frees semaphores left behind by a killed process. Its warning would reach the terminal after the
    command has ended, and the user could do nothing about it.
    """
    from multiprocessing.resource_tracker import ensure_running

    sys.warnoptions.append(_TRACKER_FILTER)  # the tracker is started with the options of this interpreter
    try:
        ensure_running()
    finally:
        sys.warnoptions.remove(_TRACKER_FILTER)


def _prepare_worker(log_level: int, ending: _End) -> None:
    """Make a worker end with its parent, however that ends, and ignore Ctrl-C, which the parent handles.

    Args:
        log_level: the parent's level of the logger for simulations.
        ending: closed at the other end if the worker is to end in the middle of a simulation.
    """
    import os
    import signal
    from multiprocessing import parent_process
    from multiprocessing.connection import wait
    from threading import Thread

    logging.getLogger(_FMU_LOGGER).setLevel(log_level)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is None:
        return

    def follow() -> None:
        wait([parent.sentinel] if ending is None else [parent.sentinel, ending])
        os._exit(1)

    Thread(target=follow, daemon=True).start()


class ClusterExecutor(Executor):
    """Runs functions on the workers of a cluster.

    Args:
        client: the cluster's client, a ``distributed.Client``.
        cluster: the address that the user gave.
    """

    def __init__(self, client: Any, cluster: str) -> None:
        self._client, self._cluster = client, cluster
        self._asked: dict[Future[Any], Any] = {}

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call a function on one of the workers; if a worker dies, the cluster tries others.

        Raises:
            ModelError: if the scheduler has gone.
        """
        self.check()
        # The same call again is another call: what it does may depend on more than its arguments.
        asked = self._client.submit(fn, *args, pure=False, **kwargs)
        promised: Future[Any] = Future()
        promised.set_running_or_notify_cancel()
        self._asked[promised] = asked
        promised.add_done_callback(lambda done: self._asked.pop(done, None))
        self._client.loop.add_callback(_settle, asked, promised)
        return promised

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: FBT001, FBT002 -- as in Executor
        """Give up the tasks that have not ended; with ``wait``, wait for them instead."""
        unfinished = dict(self._asked)
        if wait and not cancel_futures:
            for promised in unfinished:
                promised.exception()
        elif self._client.status == "running":
            self._client.cancel(list(unfinished.values()))

    def slots(self) -> int:
        """Return the number of workers that the cluster has at present, as far as is known.

        Raises:
            ModelError: if the scheduler has gone.
        """
        self.check()
        return len(self._client.scheduler_info(n_workers=-1).get("workers", ()))

    def check(self) -> None:
        """Check that there still is a connection to the scheduler; while it is made again, there is.

        Raises:
            ModelError: if it could not be made again.
        """
        if self._client.status in ("closing", "closed"):
            raise ModelError(
                f"--executor {self._cluster}: the Dask scheduler there has gone; what the runs have recorded "
                "is kept, and falsifier resume goes on from there"
            )


@contextmanager
def connected(cluster: str) -> Iterator[ClusterExecutor]:
    """Connect to a cluster.

    Args:
        cluster: ``dask:tcp://HOST:PORT``, the address of a Dask scheduler.

    Raises:
        SpecError: if this is not such an address, or Dask is not installed.
        ModelError: if the scheduler cannot be reached.
    """
    if holds_credentials(cluster):
        raise SpecError(
            "--executor: expected dask:tcp://HOST:PORT without a user name and a password, which Dask does "
            "not take; certificates are stated in Dask's own configuration"
        )
    kind, _, address = cluster.partition(":")
    if kind != "dask" or not address:
        raise SpecError(f"--executor {cluster}: expected dask:tcp://HOST:PORT")
    try:
        from distributed import Client
    except ImportError:
        raise SpecError(
            f"--executor {cluster}: Dask is not installed; install it with pip install 'falsifier[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=_CONNECT_TIMEOUT)
    except (OSError, ValueError) as error:
        raise ModelError(f"--executor {cluster}: cannot reach a Dask scheduler there: {error}") from None
    with client:
        yield ClusterExecutor(client, cluster)


async def _settle(asked: Awaitable[Any], promised: "Future[Any]") -> None:
    """Wait for a task of the cluster and hand over how it ended, whatever that is."""
    import asyncio

    try:
        result = await asked
    except (asyncio.CancelledError, CancelledError):
        promised.set_exception(BrokenExecutor("the cluster has given up the task"))
    except BaseException as error:
        promised.set_exception(error)
    else:
        promised.set_result(result)
