import ast
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from falsifier.counterexamples.export.scripts import openmodelica_script, pytest_file, replay_script
from falsifier.counterexamples.store import FILE_NAME, load, to_store
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.loading import load_problem
from falsifier.problem.source import ProblemSource
from falsifier.testing import lag_problem
from tests.command import ROOT
from tests.counterexamples.export.support import AT_INPUTS, confirmed, exported


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
    assert imported(tmp_path / "replay.py") - sys.stdlib_module_names == {
        "fmpy",
        "numpy",
    }  # which FMPy brings
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


def imported(script: Path) -> set[str]:
    """Packages that a script imports."""
    nodes = list(ast.walk(ast.parse(script.read_text())))
    modules = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    modules += [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    return {module.partition(".")[0] for module in modules}


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


def test_the_openmodelica_script_has_the_experiment_the_inputs_and_the_start_values() -> None:
    script = openmodelica_script(load_problem("AT1"), {"finalDrive": 3.25})
    assert script is not None
    for part in (
        'loadFile("ArchComp/package.mo")',
        "simulate(ArchComp.AT, startTime=0, stopTime=50.0, numberOfIntervals=5000",
        "-csvInput=input.csv -override=finalDrive=3.25",
        "AT1: G[0,20] (speed <= 120)",
    ):
        assert part in script
    without = openmodelica_script(load_problem("F16"), {})
    assert without is not None
    assert 'simflags=""' in without


def test_where_a_smaller_step_is_simulated_every_so_many_rows_are_kept(tmp_path: Path) -> None:
    problem = load_problem("AT1")
    problem = replace(problem, experiment=replace(problem.experiment, step_size=0.002))
    evaluation = evaluate(problem, problem.space.admit(AT_INPUTS["constant"]))
    script = replay_script(problem, evaluation, [], tmp_path)
    assert script is not None
    assert "output_interval=0.002," in script
    assert ")[::5]" in script


def test_models_that_are_no_fmu_and_problems_made_in_python_have_no_scripts(tmp_path: Path) -> None:
    problem = lag_problem()
    evaluation = evaluate(problem, problem.space.decode([1.0] * 4))
    assert replay_script(problem, evaluation, [], tmp_path) is None
    assert openmodelica_script(problem, {}) is None
    assert pytest_file(to_store(confirmed(problem, evaluation))) is None


def test_a_requirements_name_becomes_a_python_name() -> None:
    problem = lag_problem(name="R-1 <a>")
    stored = to_store(confirmed(problem, evaluate(problem, problem.space.decode([1.0] * 4))))
    script = pytest_file(stored.model_copy(update={"problem": ProblemSource(target="AT1")}))
    assert script is not None
    (function,) = (n for n in ast.parse(script).body if isinstance(n, ast.FunctionDef))
    assert function.name.startswith("test_r_1__a_")
