import json
import shutil
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from threading import Barrier
from unittest.mock import Mock

import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.model import Model
from falsifier.engines import make_engine
from falsifier.errors import JournalError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.problem import Problem
from falsifier.record.files import recorded_trajectory
from falsifier.record.journal import read_journal
from falsifier.record.records import EndedRecord, EvaluatedRecord
from falsifier.record.run import falsify, resume
from falsifier.search.budget import Budget
from falsifier.search.events import Evaluated, Event
from falsifier.search.result import Result
from falsifier.testing import lag_problem
from tests.patience import HANG
from tests.problems import decades
from tests.record.support import run
from tests.searches import stop_after

PROBLEM = lag_problem("G[0,10] (x <= 2)")
DECADES = decades("G[0,10] (x <= 2)", inputs=1)


@pytest.mark.parametrize(
    ("engine", "problem"), [("uniform", PROBLEM), ("corners", DECADES), ("surrogate", DECADES)]
)
def test_resume_from_any_line_gives_the_uninterrupted_run(
    tmp_path: Path, engine: str, problem: Problem
) -> None:
    whole = run(problem, tmp_path / "whole", engine=engine)
    lines = (tmp_path / "whole" / "journal.jsonl").read_bytes().splitlines(keepends=True)
    for keep in (1, 8, 17):
        cut = tmp_path / f"cut {keep}"
        shutil.copytree(tmp_path / "whole", cut)
        torn = lines[keep][: len(lines[keep]) // 2]
        (cut / "journal.jsonl").write_bytes(b"".join(lines[:keep]) + torn)
        resumed = run(problem, cut, engine=engine)
        assert [(e.candidate.key, e.robustness) for e in resumed.evaluations] == [
            (e.candidate.key, e.robustness) for e in whole.evaluations
        ], keep
        kinds = [r.kind for r in read_journal(cut)]
        assert (kinds.count("evaluated"), kinds.count("asked")) == (20, 20), keep


def suggested(value: float) -> str:
    return json.dumps({"rationale": "", "signals": [{"name": "u", "values": [value] * 4}]})


def test_a_reply_to_the_question_at_which_a_run_had_failed_is_recorded(tmp_path: Path) -> None:
    failed = falsify(PROBLEM, llm=ScriptedChat([suggested(0.1), *["no"] * 9]), budget=4, directory=tmp_path)
    assert failed.status == "failed"
    resume(tmp_path, problems=[PROBLEM], chat=ScriptedChat([suggested(0.2)]))
    (longer,) = resume(tmp_path, problems=[PROBLEM], chat=ScriptedChat([suggested(0.3)]), budget=5)
    assert [e.candidate.signals["u"].values[0] for e in longer.evaluations[3:]] == [0.2, 0.3]
    assert longer.spent.calls == 12


def test_a_run_that_is_stopped_while_it_is_repeated_has_spent_what_it_had(tmp_path: Path) -> None:
    replies = [suggested(0.1 * i) for i in range(5)]
    falsify(PROBLEM, llm=ScriptedChat(replies[:4]), budget=4, directory=tmp_path)
    journal = (tmp_path / "journal.jsonl").read_bytes()
    (stopped,) = resume(tmp_path, problems=[PROBLEM], chat=ScriptedChat([]), listeners=stop_after(2))
    assert stopped.status == "interrupted" and (tmp_path / "journal.jsonl").read_bytes() == journal
    (longer,) = resume(
        tmp_path, problems=[PROBLEM], chat=ScriptedChat(replies[4:]), budget=6, listeners=stop_after(5)
    )
    assert longer.spent.calls == 5
    last = read_journal(tmp_path)[-1]
    assert isinstance(last, EndedRecord) and last.status == "interrupted", "it went on before it was stopped"


def test_resume_with_another_seed_is_refused(tmp_path: Path) -> None:
    run(PROBLEM, tmp_path, budget=3)
    journal = (tmp_path / "journal.jsonl").read_bytes()
    with pytest.raises(
        JournalError, match=r"candidate 0 of the engine 'uniform' differs .* does not propose"
    ):
        resume(tmp_path, problems=[PROBLEM], engine=make_engine("uniform", PROBLEM, seed=2))
    assert (tmp_path / "journal.jsonl").read_bytes() == journal, "the run ended as it ended"


def test_time_stands_still_while_a_run_is_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = count()
    monkeypatch.setattr("falsifier.search.loop.perf_counter", lambda: float(next(ticks)))
    problem = lag_problem("G[0,10] (x <= 99)")
    whole = run(problem, tmp_path, budget=20)
    again = run(problem, tmp_path, budget=20)
    assert whole.spent.seconds > 20
    assert whole.spent.seconds <= again.spent.seconds < whole.spent.seconds + 8


def test_a_run_whose_time_is_used_up_is_still_repeated(tmp_path: Path) -> None:
    whole = run(PROBLEM, tmp_path, budget=5)
    (resumed,) = resume(tmp_path, problems=[PROBLEM], budget=Budget(8, seconds=1e-9))
    assert keys(resumed) == keys(whole)
    assert resumed.reason == "the time limit of 1e-09 s is reached"


def test_the_time_of_a_run_that_was_killed_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = count(step=10)
    monkeypatch.setattr("falsifier.search.loop.perf_counter", lambda: float(next(ticks)))
    run(PROBLEM, tmp_path, budget=5)
    journal = tmp_path / "journal.jsonl"
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:-1]))
    last = read_journal(tmp_path)[-1]
    assert isinstance(last, EvaluatedRecord) and last.elapsed > 100.0
    (resumed,) = resume(tmp_path, problems=[PROBLEM], budget=Budget(8, seconds=100.0))
    assert resumed.reason == "the time limit of 100 s is reached"
    assert resumed.spent.simulations == 5 and resumed.spent.seconds > last.elapsed


@contextmanager
def threads(jobs: int, model: Model) -> Iterator[Executor]:
    with ThreadPoolExecutor(jobs) as executor:
        yield executor


def keys(result: Result) -> list[object]:
    return [(e.candidate.key, e.candidate.origin, e.robustness) for e in result.evaluations]


def test_with_several_cores_an_engine_is_asked_as_soon_as_one_is_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("falsifier.record.run.local_executor", threads)
    whole = falsify(PROBLEM, "cma", budget=12, seed=1, jobs=3, directory=tmp_path)
    kinds = [r.kind for r in read_journal(tmp_path) if r.kind != "ended"]
    assert kinds == ["asked"] * 3 + ["evaluated", "asked"] * 9 + ["evaluated"] * 3
    (resumed,) = resume(tmp_path, problems=[PROBLEM])
    assert keys(resumed) == keys(whole)


def test_trajectories_that_were_not_kept_are_simulated_at_the_same_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("falsifier.record.run.local_executor", threads)
    whole = falsify(PROBLEM, "uniform", budget=6, seed=1, jobs=2, directory=tmp_path)
    shutil.rmtree(tmp_path / "trajectories")
    together = Barrier(2)

    def simulated(problem: Problem, candidate: Candidate) -> Evaluation:
        together.wait(HANG)
        return evaluate(problem, candidate)

    monkeypatch.setattr("falsifier.evaluation.workers.evaluate_for_all", simulated)
    events: list[Event] = []
    (resumed,) = resume(tmp_path, problems=[PROBLEM], listeners=[events.append])
    assert keys(resumed) == keys(whole)
    evaluated = [event.evaluation for event in events if isinstance(event, Evaluated)]
    assert len(evaluated) == 6 and all(each.trajectory is not None for each in evaluated)


def test_a_simulation_that_must_be_repeated_and_now_fails_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(PROBLEM, tmp_path, budget=3)
    shutil.rmtree(tmp_path / "trajectories")

    def fails(_problem: Problem, candidate: Candidate) -> Evaluation:
        return Evaluation(candidate, "timeout", reason="60 s")

    monkeypatch.setattr("falsifier.evaluation.workers.evaluate_for_all", fails)
    with pytest.raises(JournalError, match=r"simulation 1, whose .* not kept, now timed out: 60 s"):
        resume(tmp_path, problems=[PROBLEM])


def test_kept_trajectories_are_read_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole, counts = run(PROBLEM, tmp_path, budget=5), list[int]()
    reader = Mock(side_effect=recorded_trajectory)
    monkeypatch.setattr("falsifier.record.replay.recorded_trajectory", reader)
    (resumed,) = resume(
        tmp_path,
        problems=[PROBLEM],
        listeners=[lambda e: counts.append(reader.call_count) if isinstance(e, Evaluated) else None],
    )
    assert keys(resumed) == keys(whole) and counts == [1, 2, 3, 4, 5], "not all before the first is used"
