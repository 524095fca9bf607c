"""What a worker does that sees neither the campaign's directory nor its FMU."""

import copy
import os
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import pytest

from falsifier.campaigns.worker import Done, Missing, RunTask, run_task, unpack
from falsifier.fmu import FmuModel
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from falsifier.record.journal import read_journal
from falsifier.record.manifest import describe
from falsifier.record.records import EvaluatedRecord
from falsifier.search.budget import Budget
from falsifier.search.request import RunRequest
from tests.problems import easy

Sent = TypeVar("Sent")


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FALSIFIER_STORE", str(tmp_path / "store"))
    return tmp_path / "store"


def remote_task(problem: Problem, target: str) -> RunTask:
    request = RunRequest(
        problems=(ProblemSource(target=target),), engine="corners", budget=Budget(2), keep="best"
    )
    return RunTask(
        "R-0",
        request,
        problem,
        describe(request, [problem], "corners"),
        Path("/nowhere"),
        "another machine's mark",
    )


def test_a_run_comes_back_packed_where_the_directory_is_not_seen(store: Path, tmp_path: Path) -> None:
    done = run_task(remote_task(easy(), "python:tests.problems:easy"), {})
    assert isinstance(done, Done)
    assert done.packed is not None
    place = tmp_path / "campaign" / "runs" / "R-0"
    unpack(done.packed, place)
    assert any(isinstance(r, EvaluatedRecord) for r in read_journal(place))
    assert (place / "manifest.json").exists()
    assert len(list((place / "trajectories").iterdir())) == 1


def test_a_run_that_got_lost_on_its_way_is_sent_once_more(store: Path, tmp_path: Path) -> None:
    task = remote_task(easy(), "python:tests.problems:easy")
    first = run_task(task, {})
    (journal,) = store.rglob("journal.jsonl")
    recorded = journal.read_bytes()
    again = run_task(task, {})
    assert isinstance(first, Done) and isinstance(again, Done)
    assert (again.status, again.reason) == (first.status, first.reason)
    assert journal.read_bytes().startswith(recorded)
    assert journal.read_bytes()[len(recorded) :].count(b'"kind":"ended"') == 1, "nothing was simulated again"
    begun = journal.parent.with_name("R-2")
    begun.mkdir()
    for path in (journal.parent, *journal.parent.rglob("*")):
        os.utime(path, (0, 0))
    other = run_task(replace(task, name="R-1"), {})
    assert isinstance(other, Done)
    assert [path.parent.name for path in store.rglob("journal.jsonl")] == ["R-1"], "kept for a day"
    assert begun.is_dir(), "another worker is about to write there"


def test_an_fmu_that_the_worker_does_not_have_is_asked_for_and_kept(store: Path, tmp_path: Path) -> None:
    problem = load_problem("AT2")
    model = problem.model
    assert isinstance(model, FmuModel)
    content = model.path.read_bytes()
    moved = _arrived(problem, "model", _arrived(model, "path", tmp_path / "gone" / "AT.fmu"))
    task = remote_task(problem, "AT2")
    task = replace(task, problem=moved)
    assert run_task(task, {}) == Missing(model.sha256)
    assert isinstance(run_task(task, {model.sha256: content}), Done)
    assert (store / "files" / model.sha256 / "AT.fmu").read_bytes() == content
    assert isinstance(run_task(task, {}), Done), "the second time it has the file"


def _arrived(sent: Sent, name: str, value: object) -> Sent:
    """What was sent to a machine that does not have its file: nothing is read or checked when unpickling."""
    arrived = copy.copy(sent)
    object.__setattr__(arrived, name, value)
    return arrived
