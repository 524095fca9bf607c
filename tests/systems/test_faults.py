"""The known violation of each system with a fault, confirmed by every way of simulating it."""

from typing import Literal

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from tests.systems.driving import golden

SYSTEMS = {"PulseMeter": "contact", "ChargerHandshake": "command", "HeaterLimpHome": "disagreement"}


def candidate(system: str, run: str, problem: Problem) -> Candidate:
    name = SYSTEMS[system]
    values = [float(v) for v in golden(system)["runs"][run][name]]
    signal = Signal.evenly(values, stop_time=problem.space.stop_time, interpolation="constant")
    return problem.space.admit(Candidate({name: signal}, {}))


@pytest.mark.parametrize("interface", ["co-simulation", "model-exchange"])
@pytest.mark.parametrize("system", SYSTEMS)
def test_the_known_answer_violates(
    system: str, interface: Literal["co-simulation", "model-exchange"]
) -> None:
    problem = load_problem(system, parameterization="fixed", interface=interface)
    for run, expected in golden(system)["runs"].items():
        assert evaluate(problem, candidate(system, run, problem)).robustness == expected["robustness"], run


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_known_answer_is_confirmed(system: str) -> None:
    problem = load_problem(system, parameterization="fixed")
    found = evaluate(problem, candidate(system, "fault", problem))
    assert confirm(problem, found).outcome == "confirmed"


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_robustness_of_other_inputs_is_flat(system: str) -> None:
    problem = load_problem(system, parameterization="fixed")
    rng = np.random.default_rng(41)
    low, high = problem.space.bounds.T
    values = [evaluate(problem, problem.space.decode(rng.uniform(low, high))).robustness for _ in range(100)]
    assert set(values) == {0.5}
