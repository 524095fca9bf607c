"""Several requirements falsified in one search are a run for each of them."""

import shutil
from pathlib import Path
from unittest.mock import Mock

import pytest

from falsifier.campaigns.analysis import Run, load, load_run, main_table, read_published
from falsifier.errors import JournalError
from falsifier.evaluation.evaluate import evaluate
from falsifier.record.journal import holds_run, read_journal, recorded_candidates, recorded_evaluations
from falsifier.record.run import falsify, resume
from falsifier.search.result import Result
from falsifier.testing import lag_problem
from falsifier.views.report import html_report, markdown_report
from falsifier.views.text import results_text
from tests.problems import hard, impossible

PROBLEMS = (impossible(), hard(), lag_problem("G[0,10] (x <= 0.8)", name="HARDER"))
BUDGET = 24


def search(directory: Path, *, stop_at: int | None = None) -> list[Result]:
    """Search for all three, or be interrupted in a simulation."""
    calls = 0

    def interrupt(_: object) -> None:
        nonlocal calls
        calls += 1
        if calls == stop_at:
            raise KeyboardInterrupt

    listeners = [interrupt] if stop_at else []
    if holds_run(directory):
        return resume(directory, problems=PROBLEMS, listeners=listeners)
    return falsify(PROBLEMS, "uniform", seed=6, budget=BUDGET, directory=directory, listeners=listeners)


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs") / "shared"


@pytest.fixture(scope="module")
def results(directory: Path) -> dict[str, Result]:
    return {result.problem.name: result for result in search(directory)}


@pytest.fixture(scope="module")
def runs(directory: Path, results: dict[str, Result]) -> dict[str, Run]:
    return {run.requirement: run for run in load(directory)}


def test_every_requirement_has_its_own_numbers(results: dict[str, Result], runs: dict[str, Run]) -> None:
    assert list(runs) == ["NEVER", "HARD", "HARDER"]
    for name, run in runs.items():
        result = results[name]
        assert (run.status, run.reason) == (result.status, result.reason)
        assert run.simulations == result.spent.simulations == len(run.robustness)
        assert run.robustness.tolist() == [e.robustness for e in result.evaluations[: run.simulations]]
        assert run.spent.simulation_seconds == pytest.approx(result.spent.simulation_seconds)
        assert result.best is not None
        assert run.verdict == result.best.verdict
        assert run.manifest.requirement.formula == str(result.problem.requirement.formula)
    assert [runs[n].falsified for n in runs] == [False, True, True]
    assert 0 < runs["HARD"].simulations < runs["HARDER"].simulations < runs["NEVER"].simulations == BUDGET


def test_what_was_recorded_is_what_each_would_have_judged(directory: Path, runs: dict[str, Run]) -> None:
    for problem in PROBLEMS:
        recorded = recorded_evaluations(read_journal(directory), problem.name).values()
        judged = [evaluate(problem, evaluation.candidate).robustness for evaluation in recorded]
        assert runs[problem.name].robustness.tolist() == judged == [e.robustness for e in recorded]


def test_one_must_be_named(directory: Path, runs: dict[str, Run]) -> None:
    assert load_run(directory, "HARDER").simulations == runs["HARDER"].simulations
    with pytest.raises(JournalError, match="searched NEVER, HARD, HARDER; choose one"):
        load_run(directory)


def test_the_table_has_a_row_for_each_and_no_published_numbers(runs: dict[str, Run]) -> None:
    table = main_table(runs.values(), read_published())
    rates = {"NEVER": "0/1", "HARD": "1/1", "HARDER": "1/1"}
    assert [row[:3] for row in table.rows] == [(r, "uniform, shared search", rates[r]) for r in rates]


def test_reports_have_each(directory: Path, runs: dict[str, Run]) -> None:
    page = html_report(directory)
    assert f"2 of 3 requirements violated, 1 run, {BUDGET} simulations" in page
    for name, run in runs.items():
        part = page.partition(f'id="requirement-{name}"')[2].partition("</section>")[0]
        assert run.manifest.requirement.formula.replace("<", "&lt;") in part
        assert (f"violated: found after {run.simulations} simulations" in part) == run.falsified
        assert run.verdict is not None
        assert f"{run.verdict.robustness:+.6g}" in part
    markdown = markdown_report(directory)
    assert f"falsifier replay {directory / 'counterexample-HARDER.json'}" in markdown


def test_a_resumed_search_says_the_same(tmp_path: Path, runs: dict[str, Run]) -> None:
    search(tmp_path, stop_at=12)
    assert {run.status for run in load(tmp_path)} >= {"interrupted"}
    search(tmp_path)
    again = {result.problem.name: result for result in search(tmp_path)}
    for run in load(tmp_path):
        if run.falsified:
            assert again[run.requirement].spent.seconds == run.spent.seconds
        assert run.robustness.tolist() == runs[run.requirement].robustness.tolist()
        assert (run.status, run.reason) == (runs[run.requirement].status, runs[run.requirement].reason)


def test_what_one_requirement_cannot_judge_is_judged_by_the_others(tmp_path: Path) -> None:
    problems = [lag_problem("G[0,10] (sqrt(x - 5) >= 0)", name="BLIND"), impossible()]
    found = falsify(problems, "uniform", budget=5, directory=tmp_path)
    for _ in range(2):
        assert [result.status for result in found] == ["failed", "not falsified"]
        assert found[0].reason == "5 of 5 simulations could not be judged"
        assert "to continue" not in results_text(found)
        assert [e.robustness is None for e in found[1].evaluations] == [False] * 5
        for run, result in zip(load(tmp_path), found, strict=True):
            assert (run.status, run.reason) == (result.status, result.reason)
            assert run.columns()["status"] == [e.status for e in result.evaluations]
            assert all(map(bool, run.columns()["reason"])) == (run.requirement == "BLIND")
        shutil.rmtree(tmp_path / "trajectories")
        found = resume(tmp_path, problems=problems)


def test_a_folder_of_runs_is_all_of_them(tmp_path: Path, results: dict[str, Result]) -> None:
    search(tmp_path / "first")
    search(tmp_path / "second")
    assert [run.requirement for run in load(tmp_path)] == [*results, *results]


@pytest.mark.usefixtures("runs")
def test_a_report_reads_the_candidates_of_a_shared_search_once(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader = Mock(side_effect=recorded_candidates)
    monkeypatch.setattr("falsifier.record.journal.recorded_candidates", reader)
    html_report(directory)
    assert reader.call_count <= 1, "an earlier report may have read them"
