"""The same system through another interface or another version of FMI is the same system."""

from dataclasses import replace

import numpy as np
import pytest

from falsifier.fmu import FmuModel
from falsifier.problem.loading import load_problems
from tests.systems.driving import ROOT, Array

# Largest differences against the size of each output, and until when: NN is chaotic.
SYSTEMS = {
    "AFC": (1e-2, 1.0),
    "AT": (1e-3, 1.0),
    "CC": (1e-4, 1.0),
    "NN": (1e-4, 0.04),
    "F16": (1e-3, 1.0),
    "SC": (1e-4, 1.0),
}


def outputs(system: str, path: str, interface: str) -> Array:
    problem = load_problems(system)[0]
    candidate = problem.space.decode(problem.space.bounds @ np.array([0.3, 0.7]))
    model = FmuModel(ROOT / "fmus" / path, interface="co-simulation")
    model = replace(model, interface=interface)  # type: ignore[arg-type]
    trajectory = model.simulate(candidate.signals, candidate.parameters, problem.experiment)
    model.close()
    return np.column_stack([trajectory[name] for name in problem.experiment.outputs])


@pytest.mark.parametrize("system", SYSTEMS)
def test_model_exchange_agrees_with_co_simulation(system: str) -> None:
    tolerance, share = SYSTEMS[system]
    one = outputs(system, f"{system}.fmu", "co-simulation")
    other = outputs(system, f"{system}.fmu", "model-exchange")
    n = round(share * len(one))
    assert np.all(np.abs(one - other)[:n] <= tolerance * np.abs(one).max(axis=0))


@pytest.mark.parametrize("system", ["AT", "CC"])
def test_fmi_3_agrees_with_fmi_2(system: str) -> None:
    one = outputs(system, f"{system}.fmu", "co-simulation")
    assert np.abs(one - outputs(system, f"{system}_fmi3.fmu", "co-simulation")).max() < 1e-8
