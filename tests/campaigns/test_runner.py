import threading
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from falsifier.campaigns import CampaignRequest, Follower, Progress, cross, resume_campaign, run_campaign
from falsifier.campaigns.analysis import load as load_runs
from falsifier.campaigns.directory import campaign_lock
from falsifier.counterexamples.case import counterexample_case
from falsifier.counterexamples.store import load_counterexample, replay
from falsifier.errors import JournalError, SpecError
from falsifier.problem.source import ProblemSource
from falsifier.record.records import Record, parse_line
from falsifier.record.run import falsify, resume
from falsifier.search.budget import Budget
from falsifier.views.campaign_progress import Scoreboard
from tests import problems
from tests.campaigns.support import outcomes, request, work_in_threads


@pytest.fixture(autouse=True)
def threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """test_kill.py has real processes."""
    work_in_threads(monkeypatch)


def test_each_run_is_the_one_that_runs_alone(tmp_path: Path) -> None:
    run_campaign(request("easy", "hard", engines=("uniform", "corners")), tmp_path / "c")
    found = {(o[0], o[3], o[6].robustness) for o in outcomes(tmp_path / "c")}  # type: ignore[attr-defined]
    expected = set()
    for name in request("easy", "hard", engines=("uniform", "corners")).named():
        target, engine, seed = name.split("-")[:3]
        result = falsify(getattr(problems, target)(), engine, budget=20, seed=int(seed))
        assert result.best is not None
        expected.add((name, result.spent.simulations, result.best.robustness))
    assert found == expected


def test_resume_repeats_nothing_that_is_finished(tmp_path: Path) -> None:
    directory = tmp_path / "c"
    first = run_campaign(request("easy", "impossible"), str(directory))
    assert first.progress.finished == 4
    files = {p: p.read_bytes() for p in directory.rglob("journal.jsonl")}
    assert resume_campaign(str(directory)).progress == first.progress
    assert {p: p.read_bytes() for p in directory.rglob("journal.jsonl")} == files


def test_a_directory_is_used_by_one_process_and_for_one_campaign(tmp_path: Path) -> None:
    directory = tmp_path / "c"
    run_campaign(request("easy"), directory)
    with pytest.raises(JournalError, match=r"a campaign: .*resume_campaign\('"):
        run_campaign(request("easy"), directory)
    with pytest.raises(JournalError, match="already contains a campaign"):
        falsify(problems.easy(), "uniform", budget=1, directory=directory)
    falsify(problems.easy(), "uniform", budget=1, directory=tmp_path / "r")
    with pytest.raises(JournalError, match=r"already contains a run: .* resume\("):
        run_campaign(request("easy"), tmp_path / "r")
    with campaign_lock(directory), pytest.raises(JournalError, match="another process is working on"):
        resume_campaign(directory)
    with pytest.raises(JournalError, match=r"is a campaign: resume_campaign\('.*'\) continues it"):
        resume(directory)


def test_limits_of_the_whole_campaign_stop_it_where_it_is(tmp_path: Path) -> None:
    directory = tmp_path / "c"
    wanted = request("impossible", seeds=4, budget=2000, limits=Budget(100))
    stopped = run_campaign(wanted, directory)
    assert stopped.reason == "the budget of 100 simulations is used up"
    assert 0 < stopped.progress.spent.simulations < 8000
    assert stopped.progress.counts == {"interrupted": 1, "waiting": 3}
    assert {run.reason for run in stopped.progress.runs} == {stopped.reason, ""}
    assert not (directory / "stop").exists()
    with pytest.raises(SpecError, match="limits: tokens and cost limit language models, and none is named"):
        resume_campaign(directory, limits=Budget(cost=1.0))
    again = resume_campaign(directory)
    assert again.reason == stopped.reason
    assert again.progress.spent.simulations == stopped.progress.spent.simulations


def test_ctrl_c_while_a_journal_is_read_stops_the_campaign_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pressed = iter(["once"])

    def parse(*given: Any) -> Record:
        if threading.current_thread() is threading.main_thread() and next(pressed, None):
            raise KeyboardInterrupt
        return parse_line(*given)

    monkeypatch.setattr("falsifier.record.journal.parse_line", parse)
    end = run_campaign(request("impossible", seeds=1, budget=100_000), tmp_path)
    assert (end.reason, end.progress.counts) == ("stopped by the user", {"interrupted": 1})


def test_more_budget_finishes_a_stopped_campaign_like_an_unlimited_one(tmp_path: Path) -> None:
    wanted = request("impossible", seeds=2, budget=300)
    run_campaign(wanted, tmp_path / "whole")
    assert run_campaign(wanted.model_copy(update={"limits": Budget(10)}), tmp_path / "c").reason
    assert not resume_campaign(tmp_path / "c", limits=Budget(100_000)).reason
    assert outcomes(tmp_path / "c") == outcomes(tmp_path / "whole")


def test_failed_runs_are_told_apart_and_tried_again(tmp_path: Path) -> None:
    first = run_campaign(request("easy", "unusable", seeds=1), tmp_path / "c")
    failed = next(run for run in first.progress.runs if run.requirement == "unusable")
    assert failed.status == "failed" and "10 simulations failed" in failed.reason
    again = resume_campaign(tmp_path / "c")
    assert again.progress.counts == first.progress.counts == {"not falsified": 1, "failed": 1}


def test_another_worker_error_is_a_failed_run_in_its_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("no memory")

    monkeypatch.setattr("falsifier.campaigns.schedule.carry_out", broken)
    directory = tmp_path / "c"
    run_campaign(request("easy", seeds=1), directory)
    monkeypatch.undo()
    (run,) = Follower(directory).look().runs
    assert (run.status, run.reason) == ("failed", "RuntimeError: no memory")


def test_a_stopped_run_that_cannot_be_continued_has_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("no memory")

    run_campaign(request("impossible", seeds=1, budget=2000, limits=Budget(10)), tmp_path)
    monkeypatch.setattr("falsifier.campaigns.schedule.carry_out", broken)
    told: list[str] = []
    for _ in range(2):
        end = resume_campaign(tmp_path, limits=Budget(10_000), listeners=[Scoreboard(told.append)])
        (run,) = end.progress.runs
        assert (run.status, run.reason) == ("failed", "RuntimeError: no memory")
    assert len([line for line in told if line.endswith("no memory")]) == 1
    (journal,) = tmp_path.rglob("journal.jsonl")
    assert journal.read_bytes().count(b"no memory") == 1


def test_an_error_of_a_listener_ends_the_runs_too(tmp_path: Path) -> None:
    def full(progress: Progress) -> None:
        if progress.spent.simulations:
            raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        run_campaign(request("impossible", budget=5000), tmp_path, listeners=[full])
    first, second = Follower(tmp_path).look().runs
    assert (first.status, first.reason) == ("interrupted", "OSError: disk full")
    assert second.status == "waiting"
    assert not (tmp_path / "stop").exists()


def test_a_campaign_with_a_run_that_was_stopped_alone_has_not_ended(tmp_path: Path) -> None:
    def stop_first(progress: Progress) -> None:
        if progress.runs[0].spent.simulations and not progress.runs[1].spent.simulations:
            (tmp_path / "runs" / progress.runs[0].name / "stop").touch()

    end = run_campaign(request("impossible", budget=2000), tmp_path, listeners=[stop_first])
    assert (end.reason, end.progress.finished) == ("1 run stopped alone", 1)


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    file, fmu = tmp_path / "lag.toml", Path(__file__).resolve().parents[2] / "fmus" / "AT.fmu"
    file.write_text(
        f'[model]\nfmu = "{fmu}"\ninterface = "co-simulation"\nstop_time = 1.0\noutput_interval = 0.1\n'
        "[inputs.throttle]\ncontrol_points = 1\n[requirements.R]\nformula = 'G[0,1] (speed <= -1)'\n"
    )
    return file


def of_spec(spec: Path) -> CampaignRequest:
    runs = cross([ProblemSource(target=f"{spec}:R")], ["uniform"], seeds=[0], budget=Budget(1))
    return CampaignRequest(runs=runs)


def test_a_changed_model_is_refused(spec: Path, tmp_path: Path) -> None:
    directory = tmp_path / "c"
    run_campaign(of_spec(spec), directory)
    spec.write_text(spec.read_text() + "# changed\n")
    with pytest.raises(JournalError, match=r"lag\.toml has changed"):
        resume_campaign(directory)


def test_a_campaign_at_work_goes_on_with_the_spec_it_was_started_with(spec: Path, tmp_path: Path) -> None:
    directory, text = tmp_path / "c", spec.read_text()
    end = run_campaign(of_spec(spec), directory, listeners=[lambda _: spec.unlink(missing_ok=True)])
    assert end.progress.counts == {"falsified": 1}
    spec.write_text(text)
    (run,) = load_runs(directory)
    assert run.manifest.hashes[str(spec)] == sha256(text.encode()).hexdigest()


def test_requirements_of_the_same_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="both named 'EASY'"):
        run_campaign(request("easy", "easy_again"), tmp_path / "c")


def test_counterexamples_are_files_that_can_be_replayed(tmp_path: Path) -> None:
    run_campaign(request("hard", "impossible", seeds=1), tmp_path)
    (file,) = tmp_path.rglob("counterexample.json")
    stored = load_counterexample(file.parent)
    assert stored.problem == ProblemSource(target="python:tests.problems:hard", parameterization="fixed")
    assert replay(stored, counterexample_case(file).problem()[0]).status == "violates"
    file.unlink()
    resume_campaign(tmp_path)
    assert load_counterexample(file) == stored
