from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.trajectory import Trajectory
from falsifier.errors import MonitorError, SimulationError, SpecError
from falsifier.evaluation.confirm import (
    Confirmation,
    Movement,
    confirm,
    half_step,
    other_interface,
    step_convergence,
    sufficient_step,
)
from falsifier.evaluation.evaluate import Evaluation, evaluate, monitor_for
from falsifier.fmu import Frame
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.stl import second_monitor
from falsifier.testing import lag_problem
from tests.fmu.fixtures import isolated, ramp
from tests.fmu.small_systems import loop
from tests.stepped import euler_problem

# x(1) of x' = 1 - x by explicit Euler: 1 - 0.9**10 with 0.1 s, 1 - 0.95**20 with 0.05 s.
COARSE, FINE = 1 - 0.9**10, 1 - 0.95**20


def highest(problem: Problem) -> Evaluation:
    return evaluate(problem, problem.space.decode([1.0] * 4))


def confirmed(problem: Problem) -> Confirmation:
    return confirm(problem, highest(problem))


def test_half_the_step_needs_no_monitor_of_its_own() -> None:
    problem = euler_problem("G[1,1] (x <= 0.6)")
    assert monitor_for(half_step(problem)) is monitor_for(problem)


def test_a_violation_that_stays_at_half_the_step_is_confirmed() -> None:
    found = confirmed(euler_problem("G[1,1] (x <= 0.6)"))
    assert found.outcome == "confirmed"
    assert found.robustness == found.reference == pytest.approx(0.6 - COARSE)
    assert found.halved == pytest.approx(0.6 - FINE)
    assert f"(0.05 s) gives {0.6 - FINE:+.6g}" in found.reason


def test_a_violation_that_vanishes_at_half_the_step_is_fragile_and_says_by_how_much() -> None:
    found = confirmed(euler_problem("G[1,1] (x <= 0.65)"))
    assert COARSE > 0.65 > FINE
    assert found.outcome == "fragile"
    assert found.halved == pytest.approx(0.65 - FINE)
    assert f"does not violate: robustness {0.65 - FINE:+.6g}" in found.reason
    assert f"a change of {COARSE - FINE:+.4g}" in found.reason


def test_a_model_without_a_communication_step_says_so() -> None:
    found = confirmed(lag_problem())
    assert found.outcome == "confirmed"
    assert found.halved == found.robustness
    assert "do not depend on the communication step" in found.reason


def test_a_step_that_the_model_refuses_is_said_and_does_not_refute() -> None:
    found = confirmed(euler_problem("G[1,1] (x <= 0.6)", smallest_step=0.08))
    assert (found.outcome, found.halved) == ("confirmed", None)
    assert "(0.05 s) it failed: the step 0.05 s is too small" in found.reason


def test_what_does_not_happen_again_is_refuted() -> None:
    problem = lag_problem()
    found = confirm(replace(problem, parameters={"gain": 0.5}), highest(problem))
    assert (found.outcome, found.halved) == ("refuted", None)
    assert found.robustness == pytest.approx(0.9 - 0.5 * (1 - 0.9**100))
    assert "does not violate" in found.reason and "equal inputs give different outputs" in found.reason


def test_a_violation_that_recurs_with_other_numbers_says_so() -> None:
    problem = lag_problem()
    assert "equal inputs" not in confirmed(problem).reason
    found = confirm(replace(problem, parameters={"gain": 0.95}), highest(problem))
    assert found.outcome == "confirmed"
    assert found.reason.startswith(
        f"equal inputs give different outputs: the robustness was {highest(problem).robustness:+.6g} when "
    )


@pytest.mark.parametrize(
    ("formula", "outcome"), [("G[0,10] (x - x <= 0)", "refuted"), ("G[0,10] (x - x < 0)", "confirmed")]
)
def test_exactly_on_the_limit_the_comparison_decides(formula: str, outcome: str) -> None:
    found = confirmed(lag_problem(formula))
    assert (found.outcome, found.robustness == found.reference) == (outcome, True)
    assert ("a fresh simulation gives -0, " in found.reason) == (outcome == "confirmed")


def test_monitors_that_disagree_refute(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(second_monitor, "robustness", lambda formula, trajectory: 0.25)
    found = confirmed(lag_problem())
    assert (found.outcome, found.reference) == ("refuted", 0.25)
    assert "but rtamt computes +0.25" in found.reason


def test_without_the_second_monitor_nothing_is_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(formula: object, trajectory: object) -> float:
        raise MonitorError("out of order")

    monkeypatch.setattr(second_monitor, "robustness", fail)
    found = confirmed(lag_problem())
    assert (found.outcome, found.reference) == ("refuted", None)
    assert "could not be evaluated by rtamt: out of order" in found.reason


def test_a_function_has_no_second_interface() -> None:
    with pytest.raises(SpecError, match="not an FMU"):
        other_interface(lag_problem())


def test_the_other_interface_of_an_fmu_confirms_too() -> None:
    problem = load_problem("AT1")
    other = other_interface(problem)
    vector = [100.0] * 7 + [0.0] * 3
    here, there = (confirm(p, evaluate(p, p.space.decode(vector))) for p in (problem, other))
    assert (here.outcome, there.outcome) == ("confirmed", "confirmed")
    assert "communication step" in here.reason and "largest solver step" in there.reason
    assert there.robustness == pytest.approx(here.robustness, abs=0.05)


def test_halving_the_step_moves_outputs_by_half_the_error_of_holding() -> None:
    """A held ramp lags by half a step: x is off by h / 2 (1 - exp(-t / T)), and half of that moves."""
    model = isolated("Lag_2")
    moved = step_convergence(model, Experiment(4.0, 0.1, ("x", "T")), {"u": ramp(4.0)})
    assert moved["x"].largest == pytest.approx(0.1 / 4 * (1 - np.exp(-2.0)), rel=0.03)
    assert moved["x"].time == pytest.approx(4.0)
    assert moved["T"] == Movement(0.0, 0.0, 0.0)
    assert moved["T"].relative == 0.0
    finer = step_convergence(model, Experiment(4.0, 0.1, ("x",), step_size=0.01), {"u": ramp(4.0)})
    assert finer["x"].relative == pytest.approx(0.1 * moved["x"].relative, rel=0.05)


def test_the_step_that_a_coupling_needs_is_found() -> None:
    """With a gain of 30 and a time constant of 2 s, the loop is stable below a step of some 0.13 s."""
    experiment = Experiment(4.0, 0.2, ("plant.y",))
    model = replace(loop(), frame=Frame(values=(("pi.k", 30.0),)))
    found = sufficient_step(model, experiment, {}, share=0.01, halvings=6)
    assert found is not None and found <= 0.025
    assert step_convergence(model, replace(experiment, step_size=found), {})["plant.y"].relative <= 0.01
    assert sufficient_step(model, experiment, {}, share=0.01, halvings=0) is None


def test_a_model_of_one_step_is_not_compared_with_half_of_it() -> None:
    class OneStep:
        def simulate(self, *given: Any) -> Trajectory:
            experiment = given[2]
            if experiment.step < 0.1:
                raise SimulationError("refused", time=0.0)
            return Trajectory(experiment.times, {"x": experiment.times})

    model: Any = OneStep()
    with pytest.raises(SimulationError, match=r"^the step of 0.1 s works, .* half of it: refused$") as caught:
        step_convergence(model, Experiment(1.0, 0.1, ("x",)), {})
    assert caught.value.time == 0.0
