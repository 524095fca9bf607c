from pathlib import Path

import numpy as np
import pytest

from falsifier.campaigns.analysis import columns, frame, load, load_run
from falsifier.errors import JournalError
from falsifier.problem.source import ProblemSource
from falsifier.record import manifest
from falsifier.record.journal import (
    read_journal,
    recorded_evaluations,
)
from falsifier.record.manifest import describe
from falsifier.record.records import (
    AskedRecord,
    EvaluatedRecord,
    Record,
    line_of,
    parse_line,
)
from falsifier.search.request import RunRequest
from falsifier.stl.monitor import Verdict
from tests.campaigns.support import record_ad_hoc
from tests.problems import easy


def test_a_run_is_loaded_as_it_was(campaign: Path) -> None:
    runs = load(campaign)
    assert len(runs) == 8
    for run in runs:
        records = read_journal(run.directory)
        evaluations = list(recorded_evaluations(run.directory, records).values())
        assert run.robustness.tolist() == [e.robustness for e in evaluations]
        assert run.simulations == len(evaluations)
        assert run.falsified == (run.counterexample is not None) == (run.requirement == "HARD")
        assert run.verdict == evaluations[int(np.nanargmin(run.robustness))].verdict
    assert load_run(runs[0].directory).seed == 0


def test_columns_are_tidy_and_a_frame_where_pandas_is(campaign: Path) -> None:
    runs = load(campaign)
    table = columns(runs)
    assert {len(column) for column in table.values()} == {8}
    assert table["requirement"] == ["HARD"] * 4 + ["NEVER"] * 4
    assert sum(table["falsified"]) == 4
    assert frame(runs).groupby("requirement").falsified.mean().to_dict() == {"HARD": 1.0, "NEVER": 0.0}


def test_runs_of_formulas_without_a_name_are_told_apart(tmp_path: Path) -> None:
    record_ad_hoc(tmp_path, {"a": "G (y <= 5)", "b": "G (y <= 6)", "c": "G (y <= 5)"})
    runs = load(tmp_path)
    assert [run.requirement for run in runs] == ["stl-1", "stl-2", "stl-1"]
    assert all(run.is_ad_hoc for run in runs)
    assert [run.requirement for run in load(tmp_path / "b")] == ["stl"]


def test_a_folder_that_is_neither_is_named(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="not a run or campaign directory"):
        load(tmp_path)


def test_loading_reads_each_line_once_and_passes_over_the_candidates(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = easy()
    request = RunRequest(problems=(ProblemSource(target="python:tests.problems:easy"),))
    manifest.write(tmp_path, describe(request, [problem], "corners"))
    candidate = problem.space.decode([0.5, 0.25, 0.1, -0.3], origin="uniform").to_json()
    verdict = Verdict(robustness=0.1, critical_time=3.0, predicate="x <= 0.9", values={"x": 0.8})
    with (tmp_path / "journal.jsonl").open("wb") as file:
        for i in range(1000):
            asked = AskedRecord(
                first=i,
                n=1,
                candidates=[candidate],
                seconds=1e-4,
                requirement="EASY",
                elapsed=0.02 * i,
            )
            done = EvaluatedRecord(
                index=i, status="ok", verdicts={"EASY": verdict}, seconds=0.01, elapsed=0.02 * i + 0.01
            )
            file.write(line_of(asked, 2 * i + 1) + line_of(done, 2 * i + 2))
    parsed: list[str] = []

    def counted(line: bytes, number: int) -> Record:
        record = parse_line(line, number)
        parsed.append(record.kind)
        return record

    monkeypatch.setattr("falsifier.record.journal.parse_line", counted)
    assert load_run(tmp_path).simulations == 1000
    assert parsed == ["evaluated"] * 1000
