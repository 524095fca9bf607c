import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from falsifier import Candidate, Signal, falsify
from falsifier.campaigns.analysis import load_run
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import evaluate
from falsifier.search.budget import Spent
from falsifier.search.result import Result, evaluation_columns
from falsifier.testing import BIAS, FREE, lag_problem
from tests.problems import impossible, mostly_broken

PROBLEM = lag_problem()
NEAR = evaluate(PROBLEM, PROBLEM.space.decode([0.8] * 4))
FOUND = evaluate(PROBLEM, PROBLEM.space.decode([1.0] * 4))


def test_a_result_is_one_line_in_a_terminal() -> None:
    result = Result(problem=PROBLEM, status="not falsified", reason="", best=NEAR, spent=Spent(simulations=1))
    assert repr(result) == f"Result(LAG: not falsified, robustness {NEAR.robustness:+.6g}, 1 simulation)"


def test_a_result_and_its_record_give_every_evaluation(tmp_path: Path) -> None:
    problem = lag_problem("G[0,10] (x <= 9)", points=2, parameters=[BIAS], response=mostly_broken)
    result = falsify(problem, "uniform", budget=20, seed=2, directory=tmp_path)
    table = result.frame()
    assert list(table.simulation) == list(range(1, 21))
    assert set(table.status) == {"ok", "failed"}
    failed = table[table.status == "failed"]
    assert failed.robustness.isna().all() and failed.reason.str.len().min() > 0
    assert np.nanmin(table.robustness) == result.robustness
    assert table["u @ 0 s"].between(-1, 1).all() and table["u @ 10 s"].nunique() == table.bias.nunique() == 20
    assert table[table.status == "ok"].critical_time.notna().all()
    assert load_run(str(tmp_path)).frame().equals(table)


@pytest.mark.parametrize("jobs", [1, 4])
def test_of_a_shared_search_each_requirement_has_its_own_rows(jobs: int, tmp_path: Path) -> None:
    problems = [lag_problem(name="A"), impossible()]
    found, never = falsify(problems, "corners", budget=8, jobs=jobs, directory=tmp_path)
    assert found.falsified and len(found.evaluations) == found.spent.simulations
    for name, result in (("A", found), ("NEVER", never)):
        rows = load_run(tmp_path, name).columns()
        assert rows["robustness"] == [e.robustness for e in result.evaluations]


def test_control_points_that_move_are_told_as_text() -> None:
    result = falsify(lag_problem("G[0,10] (x <= 9)", free=FREE), "surrogate", budget=15, seed=1)
    columns = result.columns()
    assert all(":" in text and text.split()[0] in ("linear", "pchip", "constant") for text in columns["u"])
    assert {len(column) for column in columns.values()} == {len(result.evaluations)}


def test_a_constant_and_a_parameter_have_a_column_of_their_name() -> None:
    problem = lag_problem(points=1, parameters=[BIAS])
    columns = evaluation_columns([evaluate(problem, problem.space.decode([0.5, 0.25]))])
    assert (columns["u"], columns["bias"]) == ([0.5], [0.25])
    assert evaluation_columns([])["robustness"] == []


def test_every_control_point_and_every_name_has_a_column() -> None:
    steep = Signal((0.0, 4.999999998, 5.0), (0.0, 0.25, 1.0), "linear")
    columns = evaluation_columns([replace(FOUND, candidate=Candidate({"u": steep}, {"status": 3.0}))])
    assert columns["status"] == ["ok"] and columns["status (varied)"] == [3.0]
    assert [column for name, column in columns.items() if "@" in name] == [[0.0], [0.25], [1.0]]


def test_without_pandas_the_cure_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(SpecError, match=r"pip install 'falsifier\[frames\]'"):
        falsify(impossible(), "uniform", budget=1).frame()
