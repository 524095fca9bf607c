import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from falsifier.core.files import bundled
from falsifier.counterexamples.case import counterexample_case
from falsifier.counterexamples.regression import Database
from falsifier.counterexamples.store import beside, load_counterexample, replay, save, to_store
from falsifier.errors import JournalError, SimulationError, SpecError
from falsifier.evaluation.confirm import Confirmation, confirm
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from falsifier.record.journal import open_journal
from falsifier.record.run import falsify
from falsifier.search.budget import Spent
from falsifier.testing import Array, lag_problem
from tests.problems import impossible, never
from tests.record.test_summary import confirmed
from tests.stepped import euler_problem

SPEC = """
model = { fmu = "AT.fmu", interface = "co-simulation", stop_time = 30 }
inputs.throttle.control_points = 2
inputs.brake.value = 0
parameters.finalDrive = 3.23
requirements.R.formula = "G[0,20] (speed <= 120)"
"""


def violation(problem: Problem) -> Confirmation:
    vector = [d.high for d in problem.space.dimensions]
    return confirm(problem, evaluate(problem, problem.space.decode(vector)))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "project"
    folder.mkdir()
    shutil.copy(bundled("fmus") / "AT.fmu", folder / "AT.fmu")
    (folder / "my.toml").write_text(SPEC)
    return folder


def test_a_file_finds_its_spec_from_anywhere_and_after_moving_house(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    problem = load_problem("my.toml:R", parameters={"finalDrive": 3.225})
    path = Database(Path("counterexamples")).save(problem, to_store(violation(problem)))
    assert json.loads(path.read_text())["problem"]["target"] == "../../../my.toml:R"
    monkeypatch.chdir(tmp_path)
    folder.rename(tmp_path / "moved")
    stored = load_counterexample(tmp_path / "moved" / path)
    loaded, _ = counterexample_case(tmp_path / "moved" / path).problem()
    assert loaded.parameters == {"brake": 0.0, "finalDrive": 3.225}
    assert replay(stored, loaded).status == "violates"


def test_replay_says_what_has_changed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    problem = load_problem("my.toml:R")
    path = save(to_store(violation(problem)), folder / "c.json")
    Path("my.toml").write_text(SPEC.replace("120", "130"))
    with Path("AT.fmu").open("ab") as fmu:
        fmu.write(b"\0")  # a comment after the archive: another file with the same model
    replayed = replay(load_counterexample(path), load_problem("my.toml:R"))
    assert replayed.status == "does not violate"
    assert replayed.evaluation is not None
    assert replayed.evaluation.robustness == pytest.approx(10 + load_counterexample(path).robustness)
    assert "the FMU has changed since" in replayed.text
    assert "the requirement has changed from G[0,20] (speed <= 120) to" in replayed.text


def test_a_counterexample_of_another_parameterization_does_not_fit() -> None:
    stored = to_store(violation(lag_problem()))
    replayed = replay(stored, lag_problem(points=5))
    assert (replayed.status, replayed.evaluation) == ("does not fit", None)
    assert "expected 5 evenly spaced control points" in replayed.text


def test_a_fragile_one_is_no_violation_and_a_failing_simulation_is_an_error() -> None:
    coarse = euler_problem("G[1,1] (x <= 0.65)")
    found = violation(coarse)
    assert replay(to_store(found), coarse).status == "fragile"
    assert beside(Path("fragile-1.json"), "shrunk.json").name == "shrunk-fragile-1.json"
    broken = lag_problem(response=never)
    with pytest.raises(SimulationError, match="out of order"):
        replay(to_store(found), broken)


def test_one_that_violates_once_and_not_again_is_not_said_to_hold() -> None:
    answers = iter([1.0, 1.0, 1.0, 1.0, 0.0])

    def unsteady(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
        return {"x": np.full_like(times, next(answers))}

    problem = lag_problem("G[0,10] (x <= 0.5)", response=unsteady)
    again = replay(to_store(violation(problem)), problem)
    assert again.status == "does not violate" and again.confirmation is not None
    assert "violated, which is not confirmed any more: x <= 0.5 was violated" in again.text


@pytest.mark.parametrize(
    ("content", "message"),
    [("hello", "not a counterexample file"), ("[1]", "json of a run"), ('{"format": 2}', "format: not a")],
)
def test_a_damaged_file_is_named(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "c.json").write_text(content)
    with pytest.raises(SpecError, match=f"c.json: .*{message}"):
        load_counterexample(tmp_path / "c.json")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"values": [1.0]}, r"candidate\.signals\.u: 2 times and 1 values"),
        ({"times": None}, r"candidate\.signals\.u: expected times, values and interpolation"),
        (
            {"times": [0.0, 0.0]},
            r"candidate\.signals\.u: control-point times must increase strictly from 0, got 0.0 after 0.0",
        ),
        ({"values": ["a", "b"]}, r"candidate\.signals\.u: control-point times and values: expected"),
    ],
)
def test_what_is_wrong_in_an_edited_file_is_named(
    tmp_path: Path, change: dict[str, object], message: str
) -> None:
    stored = to_store(violation(lag_problem(points=2)))
    stored.candidate["signals"]["u"] |= change
    with pytest.raises(SpecError, match=rf"n2\.json: {message}"):
        load_counterexample(save(stored.model_copy(), tmp_path / "n2.json"))


def test_a_run_without_it_is_read_from_its_journal(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    result = falsify("my.toml:R", "corners", budget=5, directory="run")
    assert result.counterexample is not None
    monkeypatch.chdir("run")
    with pytest.raises(JournalError, match=r"my\.toml, which is not seen from this folder"):
        load_counterexample(Path("../run"))
    monkeypatch.chdir(folder)
    stored = load_counterexample(Path("run"))
    assert stored.robustness == result.counterexample.evaluation.robustness
    assert replay(stored, load_problem("my.toml:R")).text.count("changed") == 0
    assert json.loads(Path("run/counterexample.json").read_text())["problem"]["target"] == "../my.toml:R"
    Path("my.toml").rename("moved.toml")
    with pytest.raises(JournalError, match=r"my\.toml, which .* or correct problem\.target"):
        counterexample_case(Path("run")).problem()


def test_a_journal_that_confirms_what_it_does_not_record_as_a_violation_is_named(tmp_path: Path) -> None:
    falsify(impossible(), "corners", budget=3, directory=tmp_path)
    with open_journal(tmp_path) as journal:
        lost = confirmed(2, "confirmed", "", Spent())
        journal.write(lost.model_copy(update={"requirement": "NEVER"}))
        line = len(journal.records) + 1
    named = rf"journal\.jsonl: line {line} confirms .* NEVER, but simulation 3 "
    with pytest.raises(JournalError, match=named):
        load_counterexample(tmp_path)


def test_of_several_counterexamples_one_must_be_named(tmp_path: Path) -> None:
    problem = lag_problem()
    for name in ("counterexample-A.json", "counterexample-B.json"):
        save(to_store(violation(problem)), tmp_path / name)
    with pytest.raises(SpecError, match=r"several counterexamples; .*counterexample-A\.json"):
        load_counterexample(tmp_path)


def test_problems_made_in_python_cannot_be_loaded(tmp_path: Path) -> None:
    path = save(to_store(violation(lag_problem())), tmp_path / "c.json")
    with pytest.raises(SpecError, match=r"c\.json: the problem was made in Python"):
        counterexample_case(path).problem()


def test_databases_keep_requirements_of_a_name_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    database = Database(Path("kept"))
    found = to_store(violation(lag_problem()))
    targets = ("a/car.toml:LAG", "b/car.toml:LAG", "../car.toml:LAG", "a/car.fmu", "NN:LAG")
    problems = [replace(lag_problem(), source=ProblemSource(target=target)) for target in targets]
    paths = [database.save(problem, found) for problem in (*problems, lag_problem())]
    folders = ["a/car.toml/LAG", "b/car.toml/LAG", "_up/car.toml/LAG", "a/car.fmu/LAG", "NN/LAG", "LAG"]
    assert [path.parent.as_posix() for path in paths] == [f"kept/{folder}" for folder in folders]
    assert [[p for p, _ in database.fetch(problem)] for problem in problems] == [[p] for p in paths[:-1]]
    assert database.spec_of(Path("kept/_up/car.toml")).resolve() == tmp_path.parent / "car.toml"
    other = replace(lag_problem(), source=ProblemSource(target=str(tmp_path / "a" / "car.toml:LAG")))
    assert [p for p, _ in Database(tmp_path / "kept").fetch(other)] == [tmp_path / paths[0]]


def test_rights_move_with_the_file(folder: Path, tmp_path: Path) -> None:
    problem = load_problem(f"{folder / 'my.toml'}:R", allow=[f"write:{folder}"])
    path = save(to_store(violation(problem)), folder / "c.json")
    assert json.loads(path.read_text())["allow"] == ["write:."]
    folder.rename(tmp_path / "moved")
    stored = load_counterexample(tmp_path / "moved" / "c.json")
    assert stored.allow is not None and [Path(w[6:]).name for w in stored.allow] == ["moved"]
