from pathlib import Path

import pytest

from falsifier import falsify
from falsifier.core.signals import Signal
from falsifier.counterexamples.case import case_of, read_known
from falsifier.counterexamples.store import save, to_store
from falsifier.errors import JournalError, SpecError
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import simulate
from falsifier.testing import lag_problem
from tests.problems import easy, hard, impossible, unusable


def test_the_nearest_miss_has_the_smallest_robustness_of_the_run(tmp_path: Path) -> None:
    result = falsify(impossible(), "corners", budget=5, directory=tmp_path)
    found = case_of(tmp_path)
    assert result.best is not None
    assert found.candidate.key == result.best.candidate.key
    about = f"in 5 simulations; this is about the nearest miss, with robustness {result.best.robustness:+.6g}"
    assert about in found.text
    assert found.simulated(impossible()).robustness == result.best.robustness
    assert (found.place, found.file) == (tmp_path, tmp_path / "counterexample.json")


def test_a_run_with_a_counterexample_is_asked_about_that(tmp_path: Path) -> None:
    falsify(easy(), "corners", budget=5, directory=tmp_path)
    found = case_of(tmp_path)
    assert found.stored is not None and found.stored.robustness < 0 and not found.is_shrunk
    assert case_of(found.place) == found
    simpler = save(found.stored.model_copy(update={"reason": "shrunk"}), tmp_path / "shrunk.json")
    assert case_of(tmp_path) == found
    again = case_of(tmp_path, shrunk=True)
    assert (again.place, again.is_shrunk) == (simpler, True)
    assert case_of(found.place, shrunk=True) == found, "the file that was named"


def test_of_several_requirements_one_is_named(tmp_path: Path) -> None:
    problems = [hard(), impossible(), lag_problem("G[0,10] (x <= 3)", name="FAR")]
    falsify(problems, "corners", budget=5, directory=tmp_path)
    # The only counterexample needs no name.
    assert not case_of(tmp_path).is_miss
    found = case_of(tmp_path, "FAR")
    assert found.is_miss
    assert found.text.startswith("FAR was not falsified")
    assert found.file.name == "counterexample-FAR.json"
    with pytest.raises(JournalError, match="no 'OTHER'; known: HARD, NEVER, FAR"):
        case_of(tmp_path, "OTHER")
    with pytest.raises(SpecError, match="not a run directory"):
        case_of(tmp_path / "counterexample-HARD.json", "FAR")


def test_several_without_a_counterexample_must_be_chosen_from(tmp_path: Path) -> None:
    problems = [impossible(), lag_problem("G[0,10] (x <= 3)", name="FAR")]
    falsify(problems, "corners", budget=2, directory=tmp_path)
    with pytest.raises(JournalError, match="searched NEVER, FAR; choose one: requirement=NAME"):
        case_of(tmp_path)


def test_a_system_that_violates_now_is_said_to_have_changed(tmp_path: Path) -> None:
    falsify(impossible(), "corners", budget=2, directory=tmp_path)
    with pytest.raises(SpecError, match="now violates"):
        case_of(tmp_path).simulated(lag_problem("G[0,10] (x <= 0.1)", name="NEVER"))


def test_a_csv_file_is_read_as_it_is_and_says_what_is_added(tmp_path: Path) -> None:
    file = tmp_path / "u.csv"
    file.write_text("t,u\n0,-1\n10,1\n")
    found, notes = read_known(file, lag_problem(points=3))
    assert (found.signals["u"].values, notes) == ((-1.0, 1.0), [])
    file.write_text("t,u\n0,-1\n5,0\n")
    _, notes = read_known(file, lag_problem(points=3))
    assert notes == ["ends at 5 s; the last values are kept until 10 s"]


def test_a_counterexample_file_is_taken_as_it_is(tmp_path: Path) -> None:
    problem = lag_problem(points=1)
    violation = simulate(problem, {"u": Signal((0.0,), (1.0,), "linear")})
    file = save(to_store(confirm(problem, violation)), tmp_path / "counterexample.json")
    assert read_known(file, problem)[0].signals["u"].values == (1.0,)


def test_a_run_of_which_nothing_was_judged_has_no_nearest_miss(tmp_path: Path) -> None:
    falsify(unusable(), "uniform", budget=2, directory=tmp_path)
    with pytest.raises(SpecError, match=r"could be judged by .*; falsifier coverage .* says why"):
        case_of(tmp_path)
