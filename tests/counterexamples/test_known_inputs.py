from pathlib import Path

import pytest

from falsifier.core.signals import Signal
from falsifier.counterexamples.known_inputs import known_inputs
from falsifier.counterexamples.store import save, to_store
from falsifier.errors import CandidateError, FalsifierError
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import simulate
from falsifier.record.run import falsify
from falsifier.testing import lag_problem


def test_a_csv_file_is_fitted_and_says_where_it_is_from(tmp_path: Path) -> None:
    file = tmp_path / "u.csv"
    file.write_text("t,u\n0,-1\n10,1\n")
    fitted = known_inputs(file, lag_problem(points=3))
    assert fitted.candidate.signals["u"].values == pytest.approx((-1, 0, 1))
    assert (fitted.candidate.origin, fitted.candidate.rationale) == ("known", f"from {file}")
    file.write_text("t,u\n0,-1\n10,3\n")
    with pytest.raises(CandidateError, match=r"u\.csv: input 'u' at t = 10 s: 3 is outside"):
        known_inputs(file, lag_problem(points=3))


def test_of_a_run_the_nearest_miss_is_taken(tmp_path: Path) -> None:
    problem = lag_problem("G[0,10] (x <= 2)")
    result = falsify(problem, "uniform", budget=5, directory=tmp_path / "run")
    assert result.best is not None
    assert known_inputs(tmp_path / "run", problem).candidate.key == result.best.candidate.key


def test_a_counterexample_file_is_taken_as_it_is(tmp_path: Path) -> None:
    problem = lag_problem(points=1)
    violation = simulate(problem, {"u": Signal((0.0,), (1.0,), "linear")})
    file = save(to_store(confirm(problem, violation)), tmp_path / "counterexample.json")
    assert known_inputs(file, problem).candidate.signals["u"].values == (1.0,)


def test_anything_else_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FalsifierError, match=r"nothing\.json"):
        known_inputs(tmp_path / "nothing.json", lag_problem())
