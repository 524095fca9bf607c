"""Executors for evaluations: this process, its threads or other processes."""

import logging
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from errno import EMFILE, ENFILE
from functools import partial
from multiprocessing import Pipe, get_context, parent_process
from multiprocessing.connection import wait
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from threading import Thread, get_ident
from typing import Any, TypeVar

from falsifier.core.candidate import Candidate
from falsifier.core.model import Model
from falsifier.errors import MachineError, Reader, SpecError, reader, setting, speak_to
from falsifier.evaluation.evaluate import Evaluation, evaluate_for_all
from falsifier.fmu import stop_simulations
from falsifier.problem.problem import Problem

T = TypeVar("T")
# One end of a Pipe, whose class differs between systems, or None.
_End = Any

# Logger of the package that simulates FMUs; workers get the parent's level for it.
_FMU_LOGGER = "falsifier.fmu"
# Filter in the format of python -W: warnings whose message starts with this word.
_TRACKER_FILTER = "ignore:resource_tracker"


class LastingExecutor(Executor):
    """An executor that makes another one if the processes of the present one have died."""

    def __init__(self, make: Callable[[], Executor]) -> None:
        self._make = make
        self._executor = make()
        self._futures: set[Future[Any]] = set()

    def is_busy(self) -> bool:
        """Whether a task is being carried out; what waits for a process is cancelled."""
        return any(not (future.cancel() or future.done()) for future in list(self._futures))

    def submit(self, function: Callable[..., T], /, *args: Any, **options: Any) -> "Future[T]":
        """Start a task."""
        try:
            future = self._executor.submit(function, *args, **options)
        except BrokenExecutor:
            self._executor.shutdown(wait=False, cancel_futures=True)
            self._executor = self._make()
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

    Raises:
        SpecError: if the model is in Python and other processes cannot import it.
    """
    has_own = getattr(model, "has_own_processes", False)
    if jobs > 1 and not has_own:
        _check_importable(model)
    with nullcontext() if jobs == 1 else _threads(jobs) if has_own else _processes(jobs) as executor:
        yield executor


def _check_importable(model: Model) -> None:
    script = Path(getattr(sys.modules["__main__"], "__file__", None) or "")  # <stdin> is no file
    reason = "it was written in a notebook or at a prompt"
    try:
        if b"__main__" not in pickle.dumps(model) or script.is_file():
            return
    except Exception as error:  # of many types
        reason = str(error)
    raise SpecError(
        f"{setting('jobs')}: other processes cannot import the model {model.info.name!r} ({reason}): "
        "define its function in a .py file and import it from there, or simulate one at a time"
    )


@contextmanager
def _threads(jobs: int) -> Iterator[Executor]:
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
    ending, end = Pipe(duplex=False)
    executor = LastingExecutor(lambda: _process_pool(jobs, ending))
    try:
        yield executor
    finally:
        if executor.is_busy():
            end.close()
        executor.shutdown(cancel_futures=True)
        end.close()
        ending.close()


@contextmanager
def open_workers(jobs: int) -> Iterator[list[LastingExecutor]]:
    """Open so many worker processes, each of which dies alone."""
    with ExitStack() as stack:
        workers = [LastingExecutor(lambda: _process_pool(1)) for _ in range(jobs)]
        for worker in workers:
            stack.callback(worker.shutdown, cancel_futures=True)
        yield workers


def start(
    problem: Problem, candidates: Sequence[Candidate], executor: Executor | None
) -> list[Callable[[], Evaluation]]:
    """Start to simulate candidates; return functions that wait for their evaluations, in order.

    What the problem's requirement cannot judge has no verdict, and its trajectory.
    Without an executor, a function simulates when it is called. A pool of processes is lost with the first
    that dies, so its simulations are repeated one at a time, each in a process of its own; the one that ends
    that process too has the status ``crashed``.
    """
    if executor is None:
        return [partial(evaluate_for_all, problem, candidate) for candidate in candidates]
    return [partial(_wait, problem, c, executor.submit(evaluate_for_all, problem, c)) for c in candidates]


def _wait(problem: Problem, candidate: Candidate, future: "Future[Evaluation]") -> Evaluation:
    with suppress(BrokenExecutor):
        return future.result()
    with _processes(1) as alone:
        try:
            return alone.submit(evaluate_for_all, problem, candidate).result()
        except BrokenExecutor as error:
            return Evaluation(candidate, "crashed", reason=death(error))


def death(error: BrokenExecutor) -> str:
    """Say that a worker process died, and what the script lacks without which each does."""
    script = Path(getattr(sys.modules["__main__"], "__file__", None) or "")
    if script.is_file() and b"__name__" not in script.read_bytes():
        guard = 'has no line if __name__ == "__main__": around what starts them'
        return f"the worker processes died, because they import {script.name} first, and it {guard}"
    return f"the worker process died: {error}"


def _process_pool(jobs: int, ending: _End = None) -> ProcessPoolExecutor:
    _start_silent_tracker()
    level = logging.getLogger(_FMU_LOGGER).level
    told = (level, ending, reader())
    try:
        return ProcessPoolExecutor(
            jobs, mp_context=get_context("spawn"), initializer=_prepare_worker, initargs=told
        )
    except OSError as error:
        if error.errno in (EMFILE, ENFILE) or sys.platform != "linux":
            raise
        # Containers and services may have it read-only, and the system's message names nothing.
        raise MachineError(
            f"/dev/shm: {error.strerror}; workers need semaphores in it: mount a writable tmpfs there"
        ) from None


def _start_silent_tracker() -> None:
    """Start multiprocessing's resource tracker, which frees a pool's semaphores, without its warnings.

    It still frees semaphores left behind by a killed process. Its warning would reach the terminal after the
    command has ended, and the user could do nothing about it.
    """
    sys.warnoptions.append(_TRACKER_FILTER)  # the tracker is started with the options of this interpreter
    # It is to outlive the end of a session, like Ctrl-C, which it blocks itself; it keeps what is blocked.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGHUP,))
    try:
        ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        sys.warnoptions.remove(_TRACKER_FILTER)


def _prepare_worker(log_level: int, ending: _End, told: Reader) -> None:
    """Make a worker end with its parent, however that ends, and leave signals such as Ctrl-C to it.

    ``log_level`` is the parent's for simulations, ``told`` reads what the parent says, and ``ending`` is
    closed at the other end if the worker is to end in the middle of a simulation.
    """
    speak_to(told)
    logging.getLogger(_FMU_LOGGER).setLevel(log_level)
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    parent = parent_process()
    if parent is None:
        return

    def follow() -> None:
        wait([parent.sentinel] if ending is None else [parent.sentinel, ending])
        os._exit(1)

    Thread(target=follow, daemon=True).start()
