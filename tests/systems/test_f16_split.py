"""Aircraft and autopilot as two FMUs against the same as one: what differs is what the coupling costs."""

from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import evaluate
from falsifier.fmu import Component, System
from falsifier.problem.problem import Problem
from tests.systems.coupling import distances, owned, problems, simulated
from tests.systems.driving import golden

[ONE], [TWO] = problems("F16"), problems("F16split")
NAMES = {name: f"aircraft.{name}" for name in ("altitude", "phi", "Nz")} | {"mode": "autopilot.mode"}
STEP = 1 / 120
RUNS = golden("F16")["runs"]


def recording(problem: Problem, names: list[str]) -> Problem:
    return replace(problem, experiment=replace(problem.experiment, outputs=tuple(names)))


ONE_RECORDED, TWO_RECORDED = recording(ONE, list(NAMES)), recording(TWO, list(NAMES.values()))


def attitude(run: str) -> Candidate:
    return Candidate({}, {name: RUNS[run][name] * np.pi for name in ("roll", "pitch", "yaw")})


@pytest.mark.parametrize("run", ["B", "D"])
def test_the_difference_is_proportional_to_the_communication_step(run: str) -> None:
    """When the wings are level, the requested roll rate jumps; the line before goes on for half a step."""
    one = simulated(ONE_RECORDED, attitude(run))
    coarse, fine = (
        distances(one, simulated(TWO_RECORDED, owned(attitude(run), "aircraft"), step=step), NAMES)
        for step in (STEP, STEP / 2)
    )
    assert coarse["mode"] == fine["mode"] == 0, "the mode changes at the same samples"
    assert coarse["altitude"] < 0.12 and coarse["phi"] < 0.002 and coarse["Nz"] < 0.1
    assert coarse["altitude"] / fine["altitude"] == pytest.approx(2.0, rel=0.05)


def test_the_same_attitude_hits_the_ground() -> None:
    for run, expected in RUNS.items():
        evaluation = evaluate(TWO, owned(attitude(run), "aircraft"))
        assert evaluation.robustness == pytest.approx(expected["minimum"], abs=0.025), run
        assert evaluation.violated == (run == "B")


def test_the_violation_is_confirmed_at_half_the_step() -> None:
    assert confirm(TWO, evaluate(TWO, owned(attitude("B"), "aircraft"))).outcome == "confirmed"


def test_requests_that_are_held_for_a_sample_avoid_the_crash() -> None:
    system = TWO.model
    assert isinstance(system, System)
    components = system.parts | {"autopilot": Component(system.parts["autopilot"].fmu, step=1 / 30)}
    connections = {**system.connections, "aircraft.psRequest": "autopilot.psRequest"}
    held = replace(TWO, model=replace(system, components=components, connections=connections))
    robustness = evaluate(held, owned(attitude("B"), "aircraft")).robustness
    assert robustness == pytest.approx(21.1, abs=0.1)
