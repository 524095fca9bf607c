"""Which runs are given out when, to workers that do as the test says."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from falsifier.campaigns.schedule import RunTask, Schedule
from falsifier.evaluation.workers import LastingExecutor
from falsifier.problem.source import ProblemSource
from falsifier.search.request import RunRequest
from tests.patience import HANG
from tests.problems import easy

REQUEST = RunRequest(problems=(ProblemSource(target="python:tests.problems:easy"),))


def run(names: str, workers: list[LastingExecutor]) -> dict[str, str]:
    """Carry out a run per letter; return why it failed, in the order in which they ended."""
    done: dict[str, str] = {}
    tasks = [RunTask(name, REQUEST, easy(), {}, Path("unused")) for name in names]
    Schedule(tasks, workers).run(lambda t, failure: done.__setitem__(t.name, failure), lambda: True)
    return done


def test_each_worker_has_one_run_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    changed, inside, most = threading.Condition(), 0, 0

    def work(task: RunTask) -> None:
        nonlocal inside, most
        with changed:
            inside += 1
            most = max(most, inside)
            changed.notify_all()
            changed.wait_for(lambda: most >= 3, timeout=HANG)
        time.sleep(0.02)  # for one too many to come in
        with changed:
            inside -= 1

    monkeypatch.setattr("falsifier.campaigns.schedule.run_task", work)
    workers = [LastingExecutor(lambda: ThreadPoolExecutor(8)) for _ in range(3)]
    assert len(run("abcdefghi", workers)) == 9
    assert most == 3


class Mortal(Executor):
    """A process that dies of the runs d, and once of the run o."""

    died: list[str] = []  # noqa: RUF012 - of all processes of the test

    def __init__(self) -> None:
        self.broken = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        if self.broken:
            raise BrokenExecutor("dead")
        future: Future[Any] = Future()
        name = args[0].name
        if name == "d" or (name == "o" and "o" not in self.died):
            self.died.append(name)
            self.broken = True
            future.set_exception(BrokenExecutor("killed"))
        else:
            future.set_result(None)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        pass


def test_only_a_run_whose_process_dies_twice_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Mortal, "died", [])
    done = run("abdoc", [LastingExecutor(Mortal) for _ in range(2)])
    assert {name for name, failure in done.items() if failure} == {"d"}
    assert done["d"] == "the worker process died: killed"
    assert set(done) == set("abdoc")
    assert sorted(Mortal.died) == ["d", "d", "o"]
