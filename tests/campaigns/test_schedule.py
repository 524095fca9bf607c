"""Which runs are given out when, on executors that do as the test says."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from falsifier.campaigns.schedule import Schedule
from falsifier.campaigns.worker import Done, Missing, RunTask
from falsifier.evaluation.workers import Workers
from falsifier.problem.source import ProblemSource
from falsifier.record.manifest import describe
from falsifier.search.budget import Budget
from falsifier.search.request import LLMSettings, RunRequest
from tests.patience import HANG
from tests.problems import easy

PROBLEM = easy()


def task(name: str, model: str | None = None) -> RunTask:
    request = RunRequest(
        problems=(ProblemSource(target="python:tests.problems:easy"),),
        llm=LLMSettings(name=model) if model else None,
        budget=Budget(1),
    )
    return RunTask(name, request, PROBLEM, describe(request, [PROBLEM], "corners"), Path("unused"), "")


def run(
    tasks: list[RunTask],
    workers: Workers,
    monkeypatch: pytest.MonkeyPatch,
    work: Callable[..., Any],
    calls: int = 8,
) -> dict[str, Done]:
    monkeypatch.setattr("falsifier.campaigns.schedule.run_task", work)
    done: dict[str, Done] = {}
    Schedule(tasks, workers, calls=calls).run(lambda t, d: done.__setitem__(t.name, d), lambda: True)
    return done


def threads(slots: int) -> Workers:
    return Workers(lambda: ThreadPoolExecutor(8), lambda: slots)


class Gauge:
    """Counts how many calls are inside at a time; they stay until as many as expected were."""

    def __init__(self, expected: int) -> None:
        self.expected = expected
        self.changed = threading.Condition()
        self.inside = self.most = 0

    def __call__(self, task: RunTask, files: object) -> Done:
        with self.changed:
            self.inside += 1
            self.most = max(self.most, self.inside)
            self.changed.notify_all()
            self.changed.wait_for(lambda: self.most >= self.expected, timeout=HANG)
        time.sleep(0.02)  # for one too many to come in
        with self.changed:
            self.inside -= 1
        return Done("not falsified", "")


def test_never_more_runs_than_slots(monkeypatch: pytest.MonkeyPatch) -> None:
    gauge = Gauge(3)
    done = run([task(str(i)) for i in range(9)], threads(3), monkeypatch, gauge)
    assert len(done) == 9
    assert gauge.most == 3


def test_runs_with_a_language_model_have_a_limit_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    asking, together = Gauge(2), Gauge(3)

    def work(task: RunTask, files: object) -> Done:
        return asking(task, files) if task.request.llm else together(task, files)

    tasks = [task(f"m{i}", "openai/any") for i in range(6)] + [task(f"n{i}") for i in range(6)]
    done = run(tasks, threads(5), monkeypatch, work, calls=2)
    assert len(done) == 12
    assert asking.most == 2
    assert together.most == 3


def test_a_missing_file_is_sent_once_it_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a.fmu"
    file.write_bytes(b"content")
    monkeypatch.setattr("falsifier.campaigns.schedule.fmu_file", lambda problem, digest: file)
    sent: list[dict[str, bytes]] = []

    def work(task: RunTask, files: dict[str, bytes]) -> Done | Missing:
        sent.append(files)
        return Done("falsified", "") if files else Missing("digest")

    assert run([task("a")], threads(1), monkeypatch, work)["a"].status == "falsified"
    assert sent == [{}, {"digest": b"content"}]


class Mortal(Executor):
    """Breaks like a process pool when it is given the deadly run: everything in it is lost.

    While it is busy nothing else ends.
    """

    def __init__(self, *, busy: bool) -> None:
        self.busy = busy
        self.pending: list[Future[Done]] = []
        self.broken = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        if self.broken:
            raise BrokenExecutor("dead")
        future: Future[Done] = Future()
        self.pending.append(future)
        task = args[0]
        if task.name == "deadly":
            self.broken = True
            for each in self.pending:
                if not each.done():
                    each.set_exception(BrokenExecutor("killed"))
        elif not self.busy:
            future.set_result(Done("not falsified", ""))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        pass


def test_only_the_run_that_kills_workers_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Mortal] = []

    def make() -> Mortal:
        made.append(Mortal(busy=not made))
        return made[-1]

    names = ["a", "b", "deadly", "c", "last"]
    done = run([task(n) for n in names], Workers(make, lambda: 3), monkeypatch, lambda *_: None)
    assert {name: d.status for name, d in done.items()} == {
        **dict.fromkeys(["a", "b", "c", "last"], "not falsified"),
        "deadly": "failed",
    }
    assert len(made) == 3


def test_a_cluster_without_workers_is_reported_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("falsifier.campaigns.schedule._ALONE_SECONDS", 0.0)
    counts = iter([0, 0, 0, 0, 0, 0])
    workers = Workers(lambda: ThreadPoolExecutor(1), lambda: next(counts, 1))
    done = run([task("a")], workers, monkeypatch, lambda *_: Done("not falsified", ""))
    assert list(done) == ["a"]
    assert [r.message for r in caplog.records if "no workers" in r.message] == [caplog.messages[0]]


def test_a_stopped_campaign_does_not_wait_for_workers_that_have_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    class Silent(Executor):
        def __init__(self) -> None:
            self.given_up = False

        def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
            return Future()

        def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
            self.given_up = cancel_futures and not wait

    executor, goes_on, counts = Silent(), iter([True, True, False]), iter([1, 1, 0])
    workers = Workers(lambda: executor, lambda: next(counts, 0))
    done: dict[str, Done] = {}
    schedule = Schedule([task("a")], workers, calls=1)
    schedule.run(lambda t, d: done.__setitem__(t.name, d), lambda: next(goes_on, False))
    assert executor.given_up and not done
