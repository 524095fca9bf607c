import ast
import csv
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.files import bundled
from falsifier.core.signals import Interpolation, Signal
from falsifier.counterexamples.export.scripts import (
    openmodelica_script,
    replay_notes,
    replay_script,
    unplayable,
)
from falsifier.counterexamples.store import FILE_NAME
from falsifier.evaluation.evaluate import evaluate, evaluate_any
from falsifier.fmu import FmuModel
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.stl import parse
from falsifier.testing import lag_problem
from tests.counterexamples.export.support import AT_INPUTS, exported
from tests.fmu.fixtures import ME, altered, path as fmu_path


def test_the_replay_script_needs_fmpy_only_and_writes_the_trajectory(tmp_path: Path) -> None:
    problem = load_problem("AT1")
    evaluation = evaluate(problem, problem.space.admit(AT_INPUTS["held"]))
    assert evaluation.trajectory is not None
    exported(problem, evaluation, tmp_path)
    script = str(tmp_path / "replay.py")
    printed = subprocess.check_output([sys.executable, "-W", "error", script], text=True)
    assert imported(tmp_path / "replay.py") - sys.stdlib_module_names == {"fmpy", "numpy"}
    assert str(bundled("fmus")) not in (tmp_path / "replay.py").read_text(), "it can be moved"
    lines = (tmp_path / "outputs.csv").read_text().splitlines()
    assert lines[0] == "time,speed,rpm,gear"
    rows = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    np.testing.assert_allclose(rows[:, 1], evaluation.trajectory["speed"], rtol=1e-9, atol=1e-9)
    assert evaluation.verdict is not None
    critical = evaluation.verdict.moment
    header, *shown, where = printed.splitlines()
    assert header.split() == ["time", "speed"]  # the requirement speaks of nothing else
    assert [float(line.split()[0]) for line in shown] == pytest.approx(
        [critical + 0.01 * k for k in range(-3, 4)]
    )
    assert shown[3].endswith("<- decided by: speed <= 120")
    assert "all 5001 rows are in outputs.csv" in where


def test_the_replay_script_parts_long_names(capsys: pytest.CaptureFixture[str]) -> None:
    problem = load_problem("AT1")
    script = replay_script(problem, evaluate(problem, problem.space.admit(AT_INPUTS["held"])), [])
    names, table = ["time", "car.wheels.left.speed"], np.zeros(3, [("time", float)])
    end = re.sub(r"(?m)^shown = .*$", f"shown = {names}", script[script.index("shown = ") :])
    exec(end, {"result": table, "columns": dict.fromkeys(names, table["time"])})
    header, row, *_ = capsys.readouterr().out.splitlines()
    assert header.split() == names and len(row.partition("  <-")[0]) == len(header)


def test_the_replay_script_tells_a_value_from_a_limit_that_is_near(
    capsys: pytest.CaptureFixture[str],
) -> None:
    problem = load_problem("AT1")
    evaluation = evaluate(problem, problem.space.admit(AT_INPUTS["held"]))
    assert evaluation.verdict is not None
    values = {**evaluation.verdict.values, "speed": 1000000.001}
    near = replace(evaluation, verdict=replace(evaluation.verdict, robustness=-0.0005, values=values))
    script = replay_script(problem, near, [])
    speed = np.full(3, 1000000.001)
    table = np.zeros(3, [("time", float)])
    exec(
        script[script.index("shown = ") :],
        {"result": table, "columns": {"time": table["time"], "speed": speed}},
    )
    assert "1000000.001  <- " in capsys.readouterr().out


def test_the_replay_script_shows_what_broke_and_not_the_condition_that_decided() -> None:
    problem = load_problem("AT1")
    formula = parse("G[0,20] (speed >= 80 -> rpm <= 100)")
    problem = replace(problem, requirement=replace(problem.requirement, formula=formula))
    evaluation = evaluate(problem, problem.space.admit(AT_INPUTS["held"]))
    verdict = evaluation.verdict
    assert verdict is not None and verdict.predicate == "speed >= 80"
    script = replay_script(problem, evaluation, ["throttle", "brake"])
    told = [
        script.index(part) for part in ("rpm <= 100 was violated from ", "while speed >= 80 held", "Recorded")
    ]
    assert told == sorted(told)
    assert f'result["time"] - {verdict.moment!r}' in script
    assert "'  <- violated: rpm <= 100'" in script


def replayed(
    problem: Problem, candidate: Candidate, directory: Path, *, rtol: float = 1e-9, atol: float = 1e-9
) -> dict[str, list[float]]:
    """Export a candidate, run replay.py, and return the columns of its table, which are as simulated here."""
    evaluation = evaluate_any(problem, candidate)
    problem.model.close()
    assert evaluation.trajectory is not None, evaluation.reason
    exported(problem, evaluation, directory)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["replay.py"])
        run_path(str(directory / "replay.py"))
    with (directory / "outputs.csv").open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    found = {name: [float(row[k]) for row in rows] for k, name in enumerate(header)}
    for name in problem.experiment.outputs:
        np.testing.assert_allclose(found[name], evaluation.trajectory[name], rtol=rtol, atol=atol)
    return found


def somewhere(problem: Problem, seed: int = 1) -> Candidate:
    low, high = problem.space.bounds.T
    return problem.space.decode(np.random.default_rng(seed).uniform(low, high))


@pytest.mark.parametrize("name", AT_INPUTS)
def test_steps_reproduce_in_fmpy_wherever_they_are(name: str, tmp_path: Path) -> None:
    problem = load_problem("AT1")
    replayed(problem, problem.space.admit(AT_INPUTS[name]), tmp_path)


@pytest.mark.parametrize("target", ["CC1", "F16"])
def test_interpolated_inputs_and_start_values_reproduce_in_fmpy(target: str, tmp_path: Path) -> None:
    problem = load_problem(target)
    replayed(problem, somewhere(problem), tmp_path)


@pytest.mark.parametrize("version", [2, 3])
def test_inputs_of_all_types_reproduce_in_fmpy(version: int, tmp_path: Path) -> None:
    real = "in_Real" if version == 2 else "in_Float64"
    whole = "in_Integer" if version == 2 else "in_Int32"
    problem = Problem.from_fmu(
        fmu_path(f"Echo_{version}"),
        f"G[0,2] ({real.replace('in', 'out')} <= 100)",
        inputs={real: (-5, 5, 4), whole: (0, 9, 5), "in_Boolean": (0, 1, 3), "in_Enumeration": (1, 2, 2)},
        stop_time=2.0,
        output_interval=0.01,
    )
    found = replayed(problem, somewhere(problem, seed=version), tmp_path)
    assert len(set(found[whole.replace("in", "out")])) > 2


def test_a_model_exchange_solver_of_another_tool_gets_the_same_within_its_tolerance(tmp_path: Path) -> None:
    spec = bundled("specs") / "CC.toml"
    problem = load_problem(f"{spec}:CC1", interface="model-exchange", stop_time=100.0)
    middle = problem.space.decode(problem.space.bounds.mean(axis=1))
    replayed(problem, middle, tmp_path, rtol=1e-3, atol=1e-2)


@pytest.mark.parametrize(
    ("interpolation", "hold"), [("constant", None), ("pchip", 0.35), ("linear", None), ("pchip", None)]
)
def test_a_solver_of_another_tool_gets_changes_between_two_samples_when_they_were(
    interpolation: Interpolation, hold: float | None, tmp_path: Path
) -> None:
    lag, only = fmu_path("Lag_2"), {"u": (-10.0, 10.0)}
    problem = Problem.from_fmu(
        lag, "G (y <= 9)", inputs=only, stop_time=5.0, output_interval=0.5, interface=ME
    )
    u = Signal.evenly((10.0, -10.0, 10.0, 5.0), stop_time=5.0, interpolation=interpolation, hold=hold)
    replayed(problem, Candidate({"u": u}), tmp_path, rtol=1e-3, atol=0.03)


def test_arrays_reproduce_in_fmpy(tmp_path: Path) -> None:
    problem = Problem.from_fmu(
        fmu_path("Arrays_3"),
        "G[0,10] (y[2] + x[1] <= 1e6)",
        inputs={"u[1]": (-1.0, 1.0, 2), "u[2]": (-1.0, 1.0, 2)},
        parameters={"A[1,2]": 0.5, "offset[2]": (0.0, 30.0)},
    )
    found = replayed(problem, problem.space.decode([1.0, -1.0, 0.5, 0.25, 7.0]), tmp_path)
    assert {"y[1]", "y[2]", "x[1]"} <= found.keys()
    assert json.loads((tmp_path / "start_values.json").read_text()) == {
        "A": [0.0, 0.5, -1.0, 0.0],
        "offset": [10.0, 7.0],
    }
    assert (tmp_path / "input.csv").read_text().splitlines()[:2] == ['"time","u"', "0.0,1.0 0.5"]


@pytest.mark.parametrize(
    ("name", "old", "new", "why"),
    [
        ("Lag_2", b'name="u"', b'name="time"', "an input named 'time'"),
        ("Arrays_3", b'parameter" variability="fixed', b"input", "inputs of the type Float64 of different"),
        (
            "Arrays_3",
            b'name="u"',
            b'name="u" variability="discrete"',
            "arrays of discrete inputs, such as 'u'",
        ),
    ],
)
def test_inputs_that_fmpy_cannot_take_end_the_script(
    name: str, old: bytes, new: bytes, why: str, tmp_path: Path
) -> None:
    fmu = altered(fmu_path(name), tmp_path / "a.fmu", lambda text: text.replace(old, new), ending=".xml")
    told = unplayable(FmuModel(fmu))
    assert told.startswith(f"simulate_fmu of FMPy cannot take {why}") and FILE_NAME in told
    if name == "Lag_2":
        problem = Problem.from_fmu(fmu, "G (y <= 1)", inputs={"time": (0.0, 1.0)})
        script = replay_script(problem, evaluate(problem, somewhere(problem)), ["time"])
        assert f"\nsys.exit({told!r})\n" in script


def test_the_replay_script_says_on_which_platforms_fmpy_runs_the_fmu() -> None:
    problem = Problem.from_fmu(fmu_path("Lag_2"), "G (y <= 1)", inputs={"u": (0.0, 1.0)})
    evaluation = evaluate(problem, somewhere(problem))
    assert not list(replay_notes(problem.model))
    for name, platform in (("Lag_2", "x86_64-linux"), ("win64/Lag_2", "x86_64-windows")):
        model = FmuModel(fmu_path(name))
        script = replay_script(replace(problem, model=model), evaluation, ["u"])
        assert f"FMPy runs this FMU on {platform}, for" in script.partition("import")[0]
    assert "x86_64-windows, for" in (note := "".join(replay_notes(model)))
    assert note.endswith("this is x86_64-linux, where it needs a program wine64")


def test_odd_names_and_two_names_of_one_input_reproduce_in_fmpy(tmp_path: Path) -> None:
    odd = Problem.from_fmu(fmu_path("OddNames_2"), "G[0,10] (größe.y <= 0)")
    replayed(odd, somewhere(odd), tmp_path / "odd")
    twice = Problem.from_fmu(fmu_path("Aliases_3"), "G[0,10] (plant.u + plant.y <= 0)")
    found = replayed(twice, somewhere(twice), tmp_path)
    assert found["plant.y"] == found["y"]
    assert (tmp_path / "input.csv").read_text().splitlines()[0] == '"time","u"'


def test_strings_reproduce_in_fmpy(tmp_path: Path) -> None:
    (tmp_path / "gain.txt").write_text("2.5")
    problem = Problem.from_fmu(
        fmu_path("Table_2"), "G[0,1] (y <= 0)", parameters={"fileName": str(tmp_path / "gain.txt")}
    )
    found = replayed(problem, problem.space.decode([1.0] * len(problem.space.dimensions)), tmp_path)
    assert found["y"][-1] == 2.5


def imported(script: Path) -> set[str]:
    """Packages that a script imports."""
    nodes = list(ast.walk(ast.parse(script.read_text())))
    modules = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    modules += [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    return {module.partition(".")[0] for module in modules}


def test_the_openmodelica_script_has_the_experiment_the_inputs_and_the_start_values() -> None:
    problem = load_problem("AT1")
    problem = replace(problem, experiment=replace(problem.experiment, tolerance=1e-9))
    script = openmodelica_script(problem, {"finalDrive": 3.25}, has_inputs=True)
    for part in (
        'loadFile("ArchComp/package.mo")',
        "simulate(ArchComp.AT, startTime=0, stopTime=50.0, numberOfIntervals=5000, tolerance=1e-09,",
        "-csvInput=input.csv -override=finalDrive=3.25",
        "AT1: G[0,20] (speed <= 120)",
    ):
        assert part in script
    without = openmodelica_script(load_problem("AT1"), {}, has_inputs=False)
    assert without is not None and 'simflags=""' in without and "tolerance" not in without


def test_where_a_smaller_step_is_simulated_every_so_many_rows_are_kept(tmp_path: Path) -> None:
    problem = load_problem("AT1")
    problem = replace(problem, experiment=replace(problem.experiment, step_size=0.002))
    evaluation = evaluate(problem, problem.space.admit(AT_INPUTS["constant"]))
    script = replay_script(problem, evaluation, [])
    assert "output_interval=0.002," in script
    assert ")[::5]" in script


def test_what_does_not_apply_is_left_out(tmp_path: Path) -> None:
    problem = lag_problem()
    evaluation = evaluate(problem, problem.space.decode([1.0] * 4))
    files = exported(problem, evaluation, tmp_path)
    tables = {"input.csv", "inputs.mat", "start_values.json", "start_values.ssv"}
    assert {f.name for f in files} == {FILE_NAME, *tables}
