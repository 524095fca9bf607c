import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.files import bundled
from falsifier.core.signals import Signal
from falsifier.core.space import Freedom
from falsifier.counterexamples.export import export_counterexample
from falsifier.counterexamples.export.inputs import input_table, start_values
from falsifier.counterexamples.export.tables import matlab_names, write_csv, write_json, write_mat, write_ssv
from falsifier.counterexamples.store import FILE_NAME, load, to_store
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from tests.command import ROOT
from tests.problems import lag_problem

AT_INPUTS = {
    "held": Candidate(
        {
            "throttle": Signal.evenly((90, 20, 100, 60, 95, 3, 80), stop_time=50.0),
            "brake": Signal.evenly((0, 200, 10), stop_time=50.0),
        }
    ),
    "steps between communication points": Candidate(
        {
            "throttle": Signal((0.0, 1.2345678, 20.0), (100.0, 35.0, 80.0), "constant"),
            "brake": Signal((0.0, 7.77), (0.0, 250.0), "constant"),
        }
    ),
    "constant": Candidate({"throttle": Signal((0.0,), (100.0,)), "brake": Signal((0.0,), (0.0,))}),
}


def confirmed(problem: Problem, evaluation: Evaluation) -> Confirmation:
    return Confirmation(
        problem=problem,
        evaluation=evaluation,
        outcome="confirmed",
        robustness=evaluation.robustness,
        reference=evaluation.robustness,
        reason="",
    )


def exported(problem: Problem, evaluation: Evaluation, target: str, directory: Path) -> list[Path]:
    stored = to_store(confirmed(problem, evaluation)).model_copy(
        update={"problem": ProblemSource(target=target)}
    )
    return export_counterexample(problem, stored, evaluation, directory)


def by_fmpy(problem: Problem, candidate: Candidate, directory: Path, interface: str = "CoSimulation") -> Any:
    """Simulate the exported files with plain FMPy."""
    fmpy = pytest.importorskip("fmpy")
    from fmpy.util import read_csv

    table = input_table(problem, candidate)
    start = write_json(start_values(problem, candidate), directory / "start_values.json")
    return fmpy.simulate_fmu(
        str(problem.model.path),  # type: ignore[attr-defined]
        validate=False,
        fmi_type=interface,
        stop_time=problem.experiment.stop_time,
        output_interval=problem.experiment.output_interval,
        record_events=False,
        start_values=json.loads(start.read_text()),
        input=read_csv(write_csv(table, directory / "input.csv")) if table.columns else None,
        output=list(problem.experiment.outputs),
    )


@pytest.mark.parametrize("name", AT_INPUTS)
def test_fmpy_alone_gets_the_same_trajectory_from_the_csv(tmp_path: Path, name: str) -> None:
    problem = load_problem("AT1")
    candidate = problem.space.admit(AT_INPUTS[name])
    trajectory = evaluate(problem, candidate).trajectory
    assert trajectory is not None
    result = by_fmpy(problem, candidate, tmp_path)
    for output in problem.experiment.outputs:
        np.testing.assert_allclose(result[output], trajectory[output], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("target", ["CC1", "F16"])
def test_fmpy_alone_gets_the_same_of_interpolated_inputs_and_of_start_values(
    tmp_path: Path, target: str
) -> None:
    problem = load_problem(target)
    low, high = problem.space.bounds.T
    candidate = problem.space.decode(low + np.random.default_rng(1).uniform(size=len(low)) * (high - low))
    trajectory = evaluate(problem, candidate).trajectory
    assert trajectory is not None
    result = by_fmpy(problem, candidate, tmp_path)
    for output in problem.experiment.outputs:
        np.testing.assert_allclose(result[output], trajectory[output], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("version", [2, 3])
def test_fmpy_alone_gets_the_same_of_inputs_of_all_types(tmp_path: Path, version: int) -> None:
    real = "in_Real" if version == 2 else "in_Float64"
    whole = "in_Integer" if version == 2 else "in_Int32"
    problem = Problem.from_fmu(
        ROOT / "tests" / "fixtures" / "fmus" / f"Echo_{version}.fmu",
        f"G[0,2] ({real.replace('in', 'out')} <= 100)",
        inputs={real: (-5, 5, 4), whole: (0, 9, 5), "in_Boolean": (0, 1, 3), "in_Enumeration": (1, 2, 2)},
        stop_time=2.0,
        output_interval=0.01,
    )
    low, high = problem.space.bounds.T
    candidate = problem.space.decode(np.random.default_rng(version).uniform(low, high))
    trajectory = evaluate(problem, candidate).trajectory
    assert trajectory is not None
    assert len(set(trajectory[whole.replace("in", "out")])) > 2
    result = by_fmpy(problem, candidate, tmp_path)
    for output in problem.experiment.outputs:
        np.testing.assert_allclose(result[output], trajectory[output], rtol=1e-9, atol=1e-9)


def test_a_model_exchange_solver_of_another_tool_gets_the_same_within_its_tolerance(tmp_path: Path) -> None:
    spec = bundled("specs") / "CC.toml"
    problem = load_problem(f"{spec}:CC1", interface="model-exchange", stop_time=100.0)
    low, high = problem.space.bounds.T
    candidate = problem.space.decode((low + high) / 2)
    trajectory = evaluate(problem, candidate).trajectory
    assert trajectory is not None
    result = by_fmpy(problem, candidate, tmp_path, "ModelExchange")
    np.testing.assert_allclose(result["y5"], trajectory["y5"], rtol=1e-3, atol=1e-2)


def test_the_replay_script_needs_fmpy_only_and_writes_the_trajectory(tmp_path: Path) -> None:
    problem = load_problem("AT1")
    evaluation = evaluate(problem, problem.space.admit(AT_INPUTS["held"]))
    assert evaluation.trajectory is not None
    exported(problem, evaluation, "AT1", tmp_path)
    done = subprocess.run(
        [sys.executable, "-W", "error", str(tmp_path / "replay.py")],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "falsifier" not in (tmp_path / "replay.py").read_text().split('"""')[2]
    lines = (tmp_path / "outputs.csv").read_text().splitlines()
    assert lines[0] == "time,speed,rpm,gear"
    rows = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    np.testing.assert_allclose(rows[:, 1], evaluation.trajectory["speed"], rtol=1e-9, atol=1e-9)
    assert evaluation.verdict is not None
    critical = evaluation.verdict.critical_time
    header, *shown, where = done.stdout.splitlines()
    assert header.split() == ["time", "speed"]  # the requirement speaks of nothing else
    assert [float(line.split()[0]) for line in shown] == pytest.approx(
        [critical + 0.01 * k for k in range(-3, 4)]
    )
    assert shown[3].endswith("<- critical time")
    assert "all 5001 rows are in outputs.csv" in where


def test_the_pytest_file_fails_while_the_counterexample_violates(tmp_path: Path) -> None:
    problem = load_problem("AT1")
    evaluation = evaluate(problem, problem.space.admit(AT_INPUTS["constant"]))
    assert evaluation.violated
    files = exported(problem, evaluation, "AT1", tmp_path)
    assert {f.name for f in files} == {p.name for p in tmp_path.iterdir()}
    assert "test_AT1.py" in {f.name for f in files}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path)],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 1
    assert "AT1: still violated, robustness -0.21" in done.stdout
    assert load(tmp_path / FILE_NAME).robustness == evaluation.robustness


def test_steps_stand_where_the_simulation_set_them() -> None:
    problem = load_problem("AT1")
    candidate = problem.space.admit(
        Candidate(
            {"throttle": Signal((0.0, 1.23), (100.0, 35.0), "constant"), "brake": Signal((0.0,), (0.0,))}
        )
    )
    table = input_table(problem, candidate)
    # Sampled every 0.05 s and held: the value of 1.23 s arrives at 1.25 s.
    assert table.times.tolist() == pytest.approx([0.0, 1.25, 1.25, 50.0])
    assert table.columns["throttle"].tolist() == [100.0, 100.0, 35.0, 35.0]
    assert table.columns["brake"].tolist() == [0.0] * 4


def test_interpolated_signals_have_a_row_at_every_communication_point() -> None:
    problem = lag_problem(free=Freedom(10, 0.1))
    candidate = Candidate({"u": Signal((0.0, 10.0), (-1.0, 1.0), "linear")})
    table = input_table(problem, candidate)
    assert len(table.times) == problem.experiment.samples
    np.testing.assert_allclose(table.columns["u"], np.linspace(-1, 1, 101), atol=1e-12)


def test_start_values_are_the_fixed_and_the_searched_parameters(tmp_path: Path) -> None:
    from dataclasses import replace

    problem = replace(lag_problem(), parameters={"gain": 0.1 + 0.2, "u": 0.5})
    start = start_values(problem, Candidate({}, {"x0": -1.5}))
    assert start == {"gain": 0.1 + 0.2, "x0": -1.5}
    assert json.loads(write_json(start, tmp_path / "s.json").read_text()) == start


def test_the_ssv_is_valid_and_reads_back(tmp_path: Path) -> None:
    fmpy_ssd = pytest.importorskip("fmpy.ssp.ssd")
    path = write_ssv({"x.y[1]": 0.1 + 0.2, "phi<0": -1.5}, "A & B", tmp_path / "s.ssv")
    read = fmpy_ssd.read_ssv(str(path))  # validates against the schema of SSP 1.0
    assert read.name == "A & B"
    assert {p.name: float(p.value) for p in read.parameters} == {"x.y[1]": 0.1 + 0.2, "phi<0": -1.5}


def test_the_mat_file_holds_time_and_value_by_names_that_matlab_accepts(tmp_path: Path) -> None:
    from scipy.io import loadmat

    problem = lag_problem(free=Freedom(10, 0.1))
    table = input_table(problem, Candidate({"u": Signal((0.0, 5.0), (0.0, 1.0), "constant")}))
    content = loadmat(write_mat(table, {"a.b[2]": 3.0}, tmp_path / "i.mat"))
    assert content["u"].tolist() == [[0.0, 0.0], [5.0, 0.0], [5.0, 1.0], [10.0, 1.0]]
    assert content["start_values"]["a_b_2_"][0, 0].item() == 3.0
    assert [[cell.item() for cell in row] for row in content["names"]] == [["u", "u"], ["a_b_2_", "a.b[2]"]]
    assert matlab_names(["1 x", "1_x", "end"]) == {"1 x": "x1_x", "1_x": "x1_x_2", "end": "end_2"}


def test_what_does_not_apply_is_left_out(tmp_path: Path) -> None:
    problem = lag_problem()
    evaluation = evaluate(problem, problem.space.decode([1.0] * 4))
    stored = to_store(confirmed(problem, evaluation))
    files = export_counterexample(problem, stored, evaluation, tmp_path)
    assert {f.name for f in files} == {
        FILE_NAME,
        "input.csv",
        "inputs.mat",
        "start_values.json",
        "start_values.ssv",
    }
