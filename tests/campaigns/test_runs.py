from dataclasses import fields
from pathlib import Path

import numpy as np

from falsifier.campaigns import Method
from falsifier.campaigns.analysis import columns, frame, load, load_run
from falsifier.record.journal import read_journal, recorded_evaluations
from tests.campaigns.support import record_ad_hoc


def test_a_run_is_loaded_as_it_was(campaign: Path) -> None:
    runs = load(campaign)
    assert len(runs) == 8
    for run in runs:
        records = read_journal(run.directory)
        evaluations = list(recorded_evaluations(records, run.requirement).values())
        assert run.robustness.tolist() == [e.robustness for e in evaluations]
        assert run.simulations == len(evaluations)
        assert run.falsified == (run.counterexample is not None) == (run.requirement == "HARD")
        assert run.verdict == evaluations[int(np.nanargmin(run.robustness))].verdict
    assert [run.seed for run in runs] == [0, 1] * 4
    assert load_run(runs[1].directory).seed == 1
    assert repr(runs[0]).startswith("<HARD uniform seed 0: falsified after "), "one line, not all its values"


def test_columns_are_tidy_and_a_frame_where_pandas_is(campaign: Path) -> None:
    runs = load(campaign)
    table = columns(runs)
    assert {len(column) for column in table.values()} == {8}
    assert table["requirement"] == ["HARD"] * 4 + ["NEVER"] * 4
    assert sum(table["falsified"]) == 4
    assert {field.name for field in fields(Method)} <= table.keys(), "what tells methods apart is a column"
    assert frame(runs).groupby("requirement").falsified.mean().to_dict() == {"HARD": 1.0, "NEVER": 0.0}


def test_runs_of_formulas_without_a_name_are_told_apart(tmp_path: Path) -> None:
    record_ad_hoc(tmp_path, {"a": "G (y <= 5)", "b": "G (y <= 6)", "c": "G (y <= 5)"})
    runs = load(tmp_path)
    assert [run.requirement for run in runs] == ["stl-1", "stl-2", "stl-1"]
    assert all(run.is_ad_hoc for run in runs)
    assert [run.requirement for run in load(tmp_path / "b")] == ["stl"]


def test_no_number_makes_the_name_of_another_requirement(tmp_path: Path) -> None:
    formulas = {"a": "G (y <= 5)", "b": "G (y <= 6)", "c": "G (y <= 7)"}
    record_ad_hoc(tmp_path, formulas, named={"c": "stl-1"})
    assert [run.requirement for run in load(tmp_path)] == ["stl-2", "stl-3", "stl-1"]
