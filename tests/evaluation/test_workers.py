"""Workers: threads and processes of this machine."""

import logging
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from errno import EMFILE, EROFS
from os import strerror
from pathlib import Path
from threading import Barrier
from time import sleep
from typing import Any

import pytest

from falsifier.core.function_model import FunctionModel
from falsifier.errors import MachineError, SimulationError, SpecError, setting
from falsifier.evaluation import workers
from falsifier.evaluation.evaluate import evaluate
from falsifier.evaluation.workers import LastingExecutor, death, local_executor, open_workers, start
from falsifier.testing import lag_problem
from tests.fmu import support
from tests.fmu.fixtures import isolated, ramp, run, runners
from tests.patience import HANG, wait_until


def level() -> int:
    """Level of the logger that says it, in the process that is asked."""
    return logging.getLogger("falsifier.fmu").level


def hang(begun: Path) -> None:
    begun.touch()
    sleep(HANG)


def test_processes_are_as_quiet_as_their_parent_and_end_in_the_middle_of_a_task(tmp_path: Path) -> None:
    logger = logging.getLogger("falsifier.fmu")
    before = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with local_executor(2, lag_problem().model) as executor:
            assert executor is not None
            assert executor.submit(level).result() == logging.ERROR
            hanging = executor.submit(hang, tmp_path / "begun")
            wait_until((tmp_path / "begun").exists)
        with pytest.raises(BrokenProcessPool):
            hanging.result()
    finally:
        logger.setLevel(before)


def test_a_machine_without_shared_memory_is_told_what_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(reason, strerror(reason))

    monkeypatch.setattr(workers, "ProcessPoolExecutor", refuse)
    monkeypatch.setattr(sys, "platform", "linux")
    reason = EROFS
    with pytest.raises(MachineError, match=r"^/dev/shm: Read-only file system; .*: mount a writable tmpfs"):
        open_workers(1).__enter__()
    reason = EMFILE
    with pytest.raises(OSError, match="Too many open files"):
        open_workers(1).__enter__()


@pytest.mark.skipif(sys.platform != "linux", reason="reads what a process blocks in /proc")
def test_what_frees_shared_memory_outlives_the_end_of_a_session() -> None:
    code = """if 1:
        from multiprocessing.resource_tracker import _resource_tracker
        from falsifier.evaluation.workers import _start_silent_tracker
        _start_silent_tracker()
        for pid in (_resource_tracker._pid, "self"):
            print(*(line for line in open(f"/proc/{pid}/status") if line.startswith("SigBlk")), end="")
    """
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, check=True)
    blocked = [int(line.split()[1], 16) & 1 << (signal.SIGHUP - 1) for line in done.stdout.splitlines()]
    assert list(map(bool, blocked)) == [True, False]


def test_an_fmu_is_simulated_in_a_process_per_thread() -> None:
    model = isolated("Lag_2")
    model.close()
    together = Barrier(2)

    def simulate(level: float) -> float:
        together.wait(HANG)
        return float(run(model, ("y",), signals={"u": ramp(1.0, level)})["y"][-1])

    def workers() -> int:
        return len(runners(model))

    with local_executor(2, model) as executor:
        assert executor is not None
        one, two = executor.map(simulate, (1.0, 2.0))
        assert two == pytest.approx(2 * one) and one > 0
        assert workers() == 2
    model.close()
    assert workers() == 0


def test_a_simulation_in_a_thread_is_stopped_at_the_end() -> None:
    model = isolated("Misdeeds_2")

    def workers() -> list[int]:
        found = [runner._worker for runner in runners(model)]
        return [worker.program.pid for worker in found if worker is not None and worker.plan is not None]

    with local_executor(2, model) as executor:
        assert executor is not None
        hanging = executor.submit(run, model, ("y",), parameters={"misdeed": support.HANG}, time_limit=HANG)
        wait_until(lambda: bool(workers()))
    with pytest.raises(SimulationError, match=r"crashed|stopped"):
        hanging.result()
    assert not workers()


class Mortal(ThreadPoolExecutor):
    """An executor that is broken after its first task, as a pool is if one of its processes is killed."""

    def __init__(self) -> None:
        super().__init__(1)
        self.tasks = 0

    def submit(self, *args: Any, **options: Any) -> "Future[Any]":
        self.tasks += 1
        if self.tasks > 1:
            raise BrokenProcessPool("a process was terminated abruptly")
        return super().submit(*args, **options)


def test_processes_that_died_are_replaced() -> None:
    made: list[Mortal] = []

    def make() -> Mortal:
        made.append(Mortal())
        return made[-1]

    executor = LastingExecutor(make)
    assert [executor.submit(abs, -i).result() for i in range(3)] == [0, 1, 2]
    assert len(made) == 3
    executor.shutdown()


class Doomed(Executor):
    """A pool that is lost with all its tasks if it has several, or if its only one is deadly."""

    def __init__(self, jobs: int, ending: object) -> None:
        self._jobs = jobs

    def submit(self, function: Callable[..., Any], /, *args: Any, **options: Any) -> "Future[Any]":
        future: Future[Any] = Future()
        if self._jobs > 1 or args[1].rationale == "deadly":
            future.set_exception(BrokenProcessPool("a process was terminated abruptly"))
        else:
            future.set_result(function(*args, **options))
        return future


def test_only_what_ends_a_process_of_its_own_has_crashed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("falsifier.evaluation.workers._process_pool", Doomed)
    problem = lag_problem()
    harmless = problem.space.decode([0.1, 0.2, 0.3, 0.4])
    deadly = replace(harmless, rationale="deadly")
    with local_executor(3, problem.model) as executor:
        evaluations = [wait() for wait in start(problem, [harmless, deadly, harmless], executor)]
    assert [each.status for each in evaluations] == ["ok", "crashed", "ok"]
    assert evaluations[0].verdict == evaluate(problem, harmless).verdict
    assert evaluations[1].reason == "the worker process died: a process was terminated abruptly"
    (script := tmp_path / "mine.py").write_text("falsify(problem, jobs=2)\n")
    monkeypatch.setattr(sys.modules["__main__"], "__file__", str(script), raising=False)
    assert "import mine.py first, and it has no line if __name__" in death(BrokenExecutor("killed"))


def test_a_model_that_processes_cannot_import_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    model, main = lag_problem().model, sys.modules["__main__"]
    assert isinstance(model, FunctionModel)
    told = "jobs: other processes cannot import the model 'lag' "
    with pytest.raises(SpecError, match=rf"{told}\(.*<lambda>.*\): define its function in a .py file"):
        local_executor(2, replace(model, function=lambda *_: {})).__enter__()
    monkeypatch.setattr(model.function, "__module__", "__main__")
    monkeypatch.setattr(main, model.function.__name__, model.function, raising=False)
    monkeypatch.setattr(main, "__file__", __file__, raising=False)
    with local_executor(2, model):  # of a script, which processes import
        pass
    monkeypatch.setattr(main, "__file__", "<stdin>")
    with pytest.raises(SpecError, match=rf"{told}\(it was written in a notebook or at a prompt\)"):
        local_executor(2, model).__enter__()


def test_workers_speak_to_the_reader_of_their_parent(at_the_command_line: None) -> None:
    with open_workers(1) as (worker,):
        assert worker.submit(setting, "stop_time").result() == "--stop-time"
