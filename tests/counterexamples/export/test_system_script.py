"""FMPy alone, stepping as the exported script says, gives the trajectories of the compiled master."""

import runpy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.model import Variable
from falsifier.core.signals import Signal
from falsifier.counterexamples.export.system_script import system_script, why_no_script
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.fmu import Component, Connection, Coupling, Frame, System, fmpy_master
from falsifier.fmu.systems.network import Isolation
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.testing import lag_problem
from tests.counterexamples.export.support import exported
from tests.counterexamples.export.test_scripts import imported
from tests.fmu.fixtures import path
from tests.fmu.small_systems import LOOP, component, solved, system

DRIVE = Candidate({"pi.r": Signal((0.0, 0.35), (0.5, 1.5), "constant")}, {"plant.T": 1.5, "pi.k": 0.5})
LINEAR = {"plant.u": Connection("pi.y"), "pi.measured": Connection("plant.y", extrapolation="linear")}
SCALED = {"plant.u": Connection("pi.y", factor=0.5, offset=0.25), "pi.measured": Connection("plant.y")}


def problem_of(model: System) -> Problem:
    return Problem.from_system(
        model,
        "G (plant.y <= 10)",
        inputs={"pi.r": (0.0, 2.0)},
        parameters={"plant.T": (1.0, 2.0)},
        stop_time=1.2,
        output_interval=0.1,
    )


def same(problem: Problem, candidate: Candidate, folder: Path) -> Evaluation:
    """Export, simulate by the tables of the script, and compare all that is recorded."""
    evaluation = evaluate(problem, candidate)
    trajectory = evaluation.trajectory
    assert trajectory is not None, evaluation.reason
    exported(problem, evaluation, "not used", folder)
    rows = np.array(fmpy_master.simulate(tables(folder / "replay.py"), folder))
    np.testing.assert_allclose(rows[:, 0], trajectory.times, rtol=1e-14)
    for k, name in enumerate(problem.experiment.outputs, start=1):
        np.testing.assert_allclose(rows[:, k], trajectory[name], rtol=1e-12, atol=1e-12, err_msg=name)
    return evaluation


def tables(script: Path) -> dict[str, Any]:
    read: dict[str, Any] = runpy.run_path(str(script))["SYSTEM"]
    return read


@pytest.mark.parametrize(
    ("plant", "pi", "links", "coupling"),
    [
        ("Plant_2", "Gain_2", LOOP, Coupling()),
        ("Plant_3", "Gain_2", LINEAR, Coupling("jacobi")),
        ("Plant_2", component("Gain_3", 0.2), LINEAR, Coupling()),
        (component("Plant_3", 0.3), component("Gain_2", 0.2), LINEAR, Coupling("jacobi")),
        ("Lead_2", "Gain_3", SCALED, Coupling(loops="delay")),
        ("Lead_2", component("Gain_3", 0.2), LOOP, Coupling(loops="iterate")),
    ],
)
def test_trajectories_are_those_of_the_run(
    plant: str | Component,
    pi: str | Component,
    links: dict[str, str | Connection],
    coupling: Coupling,
    tmp_path: Path,
) -> None:
    problem = problem_of(system({"plant": plant, "pi": pi}, links, coupling))
    same(problem, DRIVE, tmp_path)


def test_inputs_of_all_types_that_change_in_event_mode(tmp_path: Path) -> None:
    names = ("Float64", "Float32", "Int8", "UInt64", "Boolean", "Enumeration")
    links = {f"second.in_{n}": f"first.out_{n}" for n in names}
    problem = Problem.from_system(
        system({"first": "Echo_3", "second": "Echo_3"}, links),
        "G (second.out_Int8 <= 100)",
        inputs={"first.in_Int8": (-5, 5), "first.in_Boolean": (0, 1), "first.in_UInt64": (0, 9)},
        stop_time=1.0,
        output_interval=0.1,
    )
    steps = {"first.in_Int8": (-5, 3), "first.in_Boolean": (1, 0), "first.in_UInt64": (2, 2)}
    signals = {name: Signal((0.0, 0.42), values, "constant") for name, values in steps.items()}
    evaluation = same(problem, Candidate(signals), tmp_path)
    assert evaluation.trajectory is not None
    assert set(evaluation.trajectory["second.out_Int8"]) == {-5.0, 3.0}
    second = tables(tmp_path / "replay.py")["components"]["second"]
    assert set(second["held"]) == {f"in_{n}" for n in names[2:]}


def test_inputs_of_the_whole_that_are_driven_and_constant(tmp_path: Path) -> None:
    whole = Frame(
        tuple(Variable(n, causality="input", start=0.25) for n in ("r", "load")), values=(("plant.x", 0.5),)
    )
    links = {**LOOP, "pi.r": Connection("r", factor=2.0, offset=0.1), "other.u": Connection("load")}
    fmus = {"plant": path("Plant_2"), "pi": path("Gain_3"), "other": path("Lag_2")}
    problem = Problem.from_system(
        System(fmus, links, frame=whole, isolate=False),
        "G (plant.y + other.y <= 10)",
        inputs={"r": (0.0, 2.0)},
        stop_time=1.0,
        output_interval=0.1,
    )
    same(problem, Candidate({"r": Signal((0.0, 1.0), (0.0, 1.0), "linear")}), tmp_path)


def test_infinite_start_values(tmp_path: Path) -> None:
    problem = problem_of(system({"plant": "Plant_2", "pi": "Gain_2"}, LOOP))
    endless = Candidate(DRIVE.signals, {**DRIVE.parameters, "plant.T": float("inf")})
    same(problem, endless, tmp_path)
    assert tables(tmp_path / "replay.py")["components"]["plant"]["start"]["T"] == float("inf")


@pytest.mark.parametrize("name", ["SharedFeeder", "F16split", "CCcars1"])
def test_bundled_systems_reproduce(name: str, tmp_path: Path) -> None:
    """For 20 steps, because Python takes seconds for all."""
    problem = load_problem(name)
    assert isinstance(problem.model, System)
    step = problem.experiment.step_size or problem.experiment.output_interval
    output = problem.experiment.outputs[0]
    short = Problem.from_system(
        replace(problem.model, isolate=False),
        f"G ({output} <= 1e9)",
        inputs={each.name: (each.low, each.high) for each in problem.space.inputs},
        parameters={each.name: (each.low, each.high) for each in problem.space.parameters},
        stop_time=20 * step,
        output_interval=step,
    )
    same(short, short.space.decode(short.space.bounds.mean(axis=1)), tmp_path)


def test_the_script_needs_fmpy_only_and_compares_the_critical_time(tmp_path: Path) -> None:
    problem = problem_of(system({"plant": "Plant_3", "pi": component("Gain_2", 0.2)}, LINEAR))
    evaluation = same(problem, DRIVE, tmp_path)
    moved = tmp_path.rename(tmp_path.with_name("moved"))
    script = moved / "replay.py"
    assert imported(script) - sys.stdlib_module_names == {"fmpy", "numpy"}
    done = subprocess.run(
        [sys.executable, "-W", "error", str(script)], capture_output=True, text=True, check=True
    )
    header, *shown, difference, where = done.stdout.splitlines()
    assert header.split() == ["time", "plant.y"]  # the requirement speaks of nothing else
    assert evaluation.verdict is not None
    (critical,) = (line.split() for line in shown if line.endswith("<- critical time"))
    assert float(critical[0]) == pytest.approx(evaluation.verdict.critical_time)
    assert float(difference.split()[-1]) <= 1e-12
    assert where.startswith("all 13 rows") and (moved / "outputs.csv").read_text().startswith("time,")


@pytest.mark.parametrize(("isolation", "said"), [("together", 0), ("each", 1)])
def test_the_script_says_that_it_does_not_separate_components(isolation: Isolation, said: int) -> None:
    here = problem_of(system({"plant": "Plant_2", "pi": "Gain_2"}, LOOP))
    evaluation = evaluate(here, DRIVE)
    fmus = {"plant": path("Plant_2"), "pi": path("Gain_2")}
    model = System(fmus, LOOP, coupling=Coupling(isolation=isolation))
    script = system_script(replace(here, model=model), evaluation, ["pi.r"])
    assert script is not None and script.count("each component had a process of its own") == said


def test_systems_with_model_exchange_have_none_and_it_is_said(tmp_path: Path) -> None:
    problem = problem_of(system({"plant": solved("Lag_2"), "pi": "Gain_3"}, LOOP))
    evaluation = evaluate(problem, DRIVE)
    assert system_script(problem, evaluation, ["pi.r"]) is None
    assert why_no_script(problem.model).startswith("no replay.py: plant of model exchange")
    files = exported(problem, evaluation, "not used", tmp_path)
    assert "replay.py" not in {file.name for file in files}


def test_other_models_have_none_and_nothing_is_said() -> None:
    problem = lag_problem()
    evaluation = evaluate(problem, problem.space.decode([1.0] * 4))
    assert system_script(problem, evaluation, []) is None and why_no_script(problem.model) == ""
