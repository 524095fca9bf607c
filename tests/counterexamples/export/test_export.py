import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.files import bundled
from falsifier.counterexamples.export import export_counterexample
from falsifier.counterexamples.export.tables import input_table, start_values, write_csv, write_json
from falsifier.counterexamples.store import FILE_NAME, to_store
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.testing import lag_problem
from tests.command import ROOT
from tests.counterexamples.export.support import AT_INPUTS, confirmed


def by_fmpy(problem: Problem, candidate: Candidate, directory: Path, interface: str = "CoSimulation") -> Any:
    """Simulate the exported files with plain FMPy."""
    fmpy = pytest.importorskip("fmpy")
    from fmpy.util import read_csv

    table = input_table(problem, candidate)
    start = write_json(start_values(problem, candidate), directory / "start_values.json", problem.model)
    return fmpy.simulate_fmu(
        str(problem.model.path),  # type: ignore[attr-defined]
        validate=False,
        fmi_type=interface,
        stop_time=problem.experiment.stop_time,
        output_interval=problem.experiment.output_interval,
        record_events=False,
        start_values=json.loads(start.read_text()),
        input=read_csv(write_csv(table, directory / "input.csv", problem.model)) if table.columns else None,
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
