from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import pytest

from falsifier.counterexamples.regression import Database, check
from falsifier.errors import SimulationError, SpecError
from falsifier.evaluation.confirm import Confirmation, confirm
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.testing import lag_problem
from tests.problems import never


def test_check_stores_a_shrunk_counterexample_and_replays_it_first(tmp_path: Path) -> None:
    problem = lag_problem("G[0,10] (x <= 0.5)")
    database = Database(tmp_path)
    first = check(problem, engine="uniform", budget=100, database=database)
    assert first.counterexample is not None
    assert first.result is not None
    assert first.counterexample.evaluation.candidate.signals["u"].values == (1.0,) * 4
    assert first.file is not None
    second = check(problem, engine="uniform", budget=100, database=database)
    assert second.result is None
    assert second.file == first.file
    assert [r.status for r in second.replayed.values()] == ["violates"]
    mended = replace(problem, parameters={"gain": 0.4})
    third = check(mended, engine="uniform", budget=5, database=database)
    assert (third.counterexample, third.file) == (None, None)
    assert [r.status for r in third.replayed.values()] == ["does not violate"]
    assert third.result is not None
    assert third.result.spent.simulations == 5


def test_a_check_that_cannot_simulate_or_is_stopped_is_no_pass() -> None:
    with pytest.raises(SimulationError, match=r"all 10 simulations failed; .*RuntimeError: out of order"):
        check(lag_problem(response=never), engine="uniform")
    with pytest.raises(KeyboardInterrupt):
        check(lag_problem(response=Mock(side_effect=KeyboardInterrupt)), engine="uniform")


def test_what_cannot_be_shrunk_stays_as_it_was_found(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls: list[Evaluation] = []

    def refute_the_shrunk(problem: Problem, evaluation: Evaluation) -> Confirmation:
        calls.append(evaluation)
        return replace(confirm(problem, evaluation), outcome="refuted")

    problem, module = lag_problem("G[0,10] (x <= 0.5)"), "falsifier.counterexamples.regression"
    monkeypatch.setattr(f"{module}.confirm", refute_the_shrunk)
    checked = check(problem, engine="uniform", budget=100)
    assert checked.result is not None
    assert checked.counterexample == checked.result.counterexample
    assert checked.counterexample and len(calls) == 1
    monkeypatch.setattr(f"{module}.shrink", Mock(side_effect=SpecError("its simulation fails this time")))
    kept = check(problem, engine="uniform", budget=100).counterexample
    assert kept and kept.candidate == checked.counterexample.candidate
    monkeypatch.setattr(f"{module}.shrink", Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        check(problem, engine="uniform", budget=100, database=Database(tmp_path))
    assert Database(tmp_path).fetch(problem)
