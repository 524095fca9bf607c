"""Trajectories of systems are those of another master, written in Python on FMPy's classes.

Its values are in golden.json, by case and variable.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.model import Variable
from falsifier.core.signals import Signal
from falsifier.fmu import Component, Connection, Coupling, Frame, System
from falsifier.problem.loading import load_problem
from tests.fmu.fixtures import path
from tests.fmu.small_systems import LINEAR, LOOP, component, system

GOLDEN: dict[str, dict[str, list[float]]] = json.loads(Path(__file__).with_name("golden.json").read_text())
Case = tuple[System, Experiment, Mapping[str, Signal], Mapping[str, float]]

DRIVE = {"pi.r": Signal((0.0, 0.35), (0.5, 1.5), "constant")}
GAINS = {"plant.T": 1.5, "pi.k": 0.5}
SCALED = {"plant.u": Connection("pi.y", factor=0.5, offset=0.25), "pi.measured": Connection("plant.y")}


def coupled(
    plant: str | Component,
    pi: str | Component,
    links: Mapping[str, str | Connection],
    coupling: Coupling | None = None,
    parameters: Mapping[str, float] = GAINS,
) -> Case:
    """A plant and its controller."""
    model = system({"plant": plant, "pi": pi}, links, coupling)
    return model, Experiment(1.2, 0.1, ("plant.x", "plant.y", "pi.y")), DRIVE, parameters


def in_event_mode() -> Case:
    """Inputs of all types, some of which change in event mode only."""
    names = ("Float64", "Float32", "Int8", "UInt64", "Boolean", "Enumeration")
    model = system(
        {"first": "Echo_3", "second": "Echo_3"}, {f"second.in_{n}": f"first.out_{n}" for n in names}
    )
    steps = {"first.in_Int8": (-5, 3), "first.in_Boolean": (1, 0), "first.in_UInt64": (2, 2)}
    signals = {name: Signal((0.0, 0.42), values, "constant") for name, values in steps.items()}
    return model, Experiment(1.0, 0.1, tuple(f"second.out_{n}" for n in names)), signals, {}


def whole(parameters: Mapping[str, float]) -> Case:
    """Inputs of the whole, one driven and one constant."""
    inputs = tuple(Variable(n, causality="input", start=0.25) for n in ("r", "load"))
    links = {**LOOP, "pi.r": Connection("r", factor=2.0, offset=0.1), "other.u": Connection("load")}
    fmus = {"plant": path("Plant_2"), "pi": path("Gain_3"), "other": path("Lag_2")}
    model = System(fmus, links, frame=Frame(inputs, values=(("plant.x", 0.5),)))
    ramp = {"r": Signal((0.0, 1.0), (0.0, 1.0), "linear")}
    return model, Experiment(1.0, 0.1, ("plant.y", "pi.y", "other.y")), ramp, parameters


def bundled(name: str) -> Case:
    """Twenty steps of a bundled system with the middle of its space."""
    problem = load_problem(name)
    assert isinstance(problem.model, System)
    step = problem.experiment.step
    candidate = problem.space.decode(problem.space.bounds.mean(axis=1))
    short = replace(problem.experiment, stop_time=20 * step, output_interval=step, step_size=None)
    return problem.model, short, candidate.signals, {**problem.parameters, **candidate.parameters}


CASES: dict[str, Callable[[], Case]] = {
    "gauss-seidel": lambda: coupled("Plant_2", "Gain_2", LOOP),
    "jacobi": lambda: coupled("Plant_3", "Gain_2", LINEAR, Coupling("jacobi")),
    "own step": lambda: coupled("Plant_2", component("Gain_3", 0.2), LINEAR),
    "own steps": lambda: coupled(
        component("Plant_3", 0.3), component("Gain_2", 0.2), LINEAR, Coupling("jacobi")
    ),
    "delayed loop": lambda: coupled("Lead_2", "Gain_3", SCALED, Coupling(loops="delay")),
    "iterated loop": lambda: coupled("Lead_2", component("Gain_3", 0.2), LOOP, Coupling(loops="iterate")),
    "infinite start": lambda: coupled("Plant_2", "Gain_2", LOOP, parameters={**GAINS, "plant.T": np.inf}),
    "event mode": in_event_mode,
    "whole": lambda: whole({}),
    "whole, set": lambda: whole({"load": 0.75}),
    "SharedFeeder": lambda: bundled("SharedFeeder"),
    "F16split": lambda: bundled("F16split"),
    "CCcars1": lambda: bundled("CCcars1"),
}


@pytest.mark.parametrize("name", CASES)
def test_trajectories_are_those_of_the_other_master(name: str) -> None:
    model, experiment, signals, parameters = CASES[name]()
    found = model.simulate(signals, parameters, experiment)
    model.close()
    assert list(GOLDEN[name]) == list(experiment.outputs)
    for output, expected in GOLDEN[name].items():
        np.testing.assert_allclose(found[output], expected, rtol=1e-12, atol=1e-12, err_msg=output)
