"""The worker's master of a system gives the trajectories of an independent one on FMPy's classes."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from falsifier.core.model import Experiment, Variable
from falsifier.core.signals import Signal
from falsifier.fmu import Component, Connection, Coupling, Frame, System
from falsifier.problem.loading import load_problem
from tests.fmu.fixtures import path
from tests.fmu.small_systems import LOOP, component, system
from tests.fmu.systems import fmpy_master

DRIVE = {"pi.r": Signal((0.0, 0.35), (0.5, 1.5), "constant")}
GAINS = {"plant.T": 1.5, "pi.k": 0.5}
LINEAR = {"plant.u": Connection("pi.y"), "pi.measured": Connection("plant.y", extrapolation="linear")}
SCALED = {"plant.u": Connection("pi.y", factor=0.5, offset=0.25), "pi.measured": Connection("plant.y")}


def compare(
    model: System,
    experiment: Experiment,
    signals: Mapping[str, Signal],
    parameters: Mapping[str, float],
    root: Path,
) -> None:
    found = model.simulate(signals, parameters, experiment)
    expected = fmpy_master.simulate(model, experiment, signals, parameters, root)
    np.testing.assert_allclose(expected[:, 0], found.times, rtol=1e-14)
    for k, name in enumerate(experiment.outputs, start=1):
        np.testing.assert_allclose(found[name], expected[:, k], rtol=1e-12, atol=1e-12, err_msg=name)
    model.close()


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
def test_methods_own_steps_extrapolation_and_loops(
    plant: str | Component,
    pi: str | Component,
    links: dict[str, str | Connection],
    coupling: Coupling,
    tmp_path: Path,
) -> None:
    model = system({"plant": plant, "pi": pi}, links, coupling)
    compare(model, Experiment(1.2, 0.1, ("plant.x", "plant.y", "pi.y")), DRIVE, GAINS, tmp_path)


def test_inputs_of_all_types_that_change_in_event_mode(tmp_path: Path) -> None:
    names = ("Float64", "Float32", "Int8", "UInt64", "Boolean", "Enumeration")
    links = {f"second.in_{n}": f"first.out_{n}" for n in names}
    model = system({"first": "Echo_3", "second": "Echo_3"}, links)
    steps = {"first.in_Int8": (-5, 3), "first.in_Boolean": (1, 0), "first.in_UInt64": (2, 2)}
    signals = {name: Signal((0.0, 0.42), values, "constant") for name, values in steps.items()}
    experiment = Experiment(1.0, 0.1, tuple(f"second.out_{n}" for n in names))
    compare(model, experiment, signals, {}, tmp_path)
    about = fmpy_master.tables(model, experiment, signals, {})["components"]["second"]
    assert set(about["held"]) == {f"in_{n}" for n in names[2:]}


def test_inputs_of_the_whole_that_are_driven_and_constant(tmp_path: Path) -> None:
    whole = Frame(
        tuple(Variable(n, causality="input", start=0.25) for n in ("r", "load")), values=(("plant.x", 0.5),)
    )
    links = {**LOOP, "pi.r": Connection("r", factor=2.0, offset=0.1), "other.u": Connection("load")}
    fmus = {"plant": path("Plant_2"), "pi": path("Gain_3"), "other": path("Lag_2")}
    model = System(fmus, links, frame=whole)
    experiment = Experiment(1.0, 0.1, ("plant.y", "pi.y", "other.y"))
    ramp = {"r": Signal((0.0, 1.0), (0.0, 1.0), "linear")}
    compare(model, experiment, ramp, {}, tmp_path / "start")
    compare(model, experiment, ramp, {"load": 0.75}, tmp_path / "set")


def test_infinite_start_values(tmp_path: Path) -> None:
    model = system({"plant": "Plant_2", "pi": "Gain_2"}, LOOP)
    endless = {**GAINS, "plant.T": float("inf")}
    compare(model, Experiment(1.2, 0.1, ("plant.x", "pi.y")), DRIVE, endless, tmp_path)


@pytest.mark.parametrize("name", ["SharedFeeder", "F16split", "CCcars1"])
def test_bundled_systems(name: str, tmp_path: Path) -> None:
    """For 20 steps, because Python takes seconds for all."""
    problem = load_problem(name)
    assert isinstance(problem.model, System)
    step = problem.experiment.step_size or problem.experiment.output_interval
    candidate = problem.space.decode(problem.space.bounds.mean(axis=1))
    short = replace(problem.experiment, stop_time=20 * step, output_interval=step, step_size=None)
    parameters = {**problem.parameters, **candidate.parameters}
    compare(problem.model, short, candidate.signals, parameters, tmp_path)


@pytest.mark.parametrize(("gain", "converges"), [(0.5, True), (2.0, False)])
def test_the_reference_finds_the_fixed_point_of_a_controller_that_measures_itself(
    gain: float, converges: bool, tmp_path: Path
) -> None:
    """y = k (r - y) with r = 1."""
    model = system({"pi": "Gain_2"}, {"pi.measured": "pi.y"}, Coupling(loops="iterate", max_rounds=50))
    experiment = Experiment(1.0, 0.5, ("pi.y",))
    if converges:
        rows = fmpy_master.simulate(model, experiment, {}, {"pi.k": gain}, tmp_path)
        assert rows[:, 1] == pytest.approx([1 / 3] * 3)
    else:
        with pytest.raises(AssertionError, match="the initialisation does not converge"):
            fmpy_master.simulate(model, experiment, {}, {"pi.k": gain}, tmp_path)
