from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from falsifier import falsify
from falsifier.core.candidate import Candidate
from falsifier.core.model import FunctionModel, ModelInfo, Variable
from falsifier.engines import make_engine
from falsifier.engines.aiming import PATIENCE, Aiming, can_aim
from falsifier.engines.protocol import Engine
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl import parse
from falsifier.testing import Array, EngineContract, lag, lag_problem


def aiming(problem: Problem, seed: int = 1) -> Aiming:
    def make(each: Problem) -> Engine:
        return make_engine("cma", each, seed=seed)

    return Aiming(make(problem), problem, make)


class TestContract(EngineContract):
    def make(self, problem: Problem, seed: int) -> Engine:
        return aiming(problem, seed)


def driven(problem: Problem, engine: Aiming, rounds: int) -> list[Evaluation]:
    found = []
    for _ in range(rounds):
        evaluations = [evaluate(problem, candidate) for candidate in engine.ask(1)]
        engine.tell(evaluations)
        found += evaluations
    return found


def flat(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Half of u's mean: the condition is out of reach."""
    return {"x": np.full_like(times, 0.5 * inputs["u"].mean())}


def test_every_other_candidate_aims_at_a_condition_that_never_held() -> None:
    problem = lag_problem("G[0,10] (x >= 0.93 -> u <= 5)", response=flat)
    found = driven(problem, aiming(problem), PATIENCE + 6)
    assert [e.candidate.aim for e in found] == [""] * PATIENCE + ["x >= 0.93", ""] * 3
    assert found[PATIENCE].candidate.rationale.startswith("aims at x >= 0.93, at the closest missed by 0.")
    assert all(e.candidate.origin == "cma" for e in found)


def test_once_the_condition_has_held_nothing_aims_at_it() -> None:
    problem = lag_problem("G[0,10] (x >= -5 -> x <= 5)")
    assert not any(e.candidate.aim for e in driven(problem, aiming(problem), PATIENCE + 4))


def test_a_side_of_a_disjunction_that_always_holds_is_made_to_fail() -> None:
    problem = lag_problem("G[0,10] (x <= 0.93 or u <= 5)", response=flat)
    assert driven(problem, aiming(problem), PATIENCE + 1)[-1].candidate.aim == "not (x <= 0.93)"


def test_only_conditions_and_disjunctions_can_be_aimed_at() -> None:
    assert not can_aim(lag_problem("G[0,10] (x <= 0.9)"))
    assert can_aim(lag_problem("G[0,10] (x <= 0.9 or u <= 0)"))


def behind_a_condition() -> Problem:
    """A bug that shows only at x >= 0.8, where y jumps; elsewhere the robustness is 50, whatever x is."""

    def response(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
        x = lag(times, {"mean": np.mean(list(inputs.values()), axis=0)}, {})["x"]
        return {"x": x, "y": np.where(x >= 0.8, 100.0, 0.0)}

    plain = lag_problem(inputs=3)
    variables = (*plain.info.variables, Variable("y", causality="output"))
    return replace(
        plain,
        model=FunctionModel(response, ModelInfo("bug", variables=variables)),
        requirement=Requirement("BUG", parse("G[0,10] (x >= 0.8 -> y <= 50)")),
        experiment=replace(plain.experiment, outputs=("x", "y")),
    )


def test_a_bug_behind_a_condition_that_the_robustness_says_nothing_about_is_found() -> None:
    problem = behind_a_condition()
    assert falsify(problem, "cma", budget=150).falsified
    assert not falsify(problem, make_engine("cma", problem, seed=0), budget=150).falsified


def test_the_aim_is_recorded_with_the_candidate() -> None:
    candidate = Candidate(aim="x >= 1")
    assert Candidate.from_json(candidate.to_json()) == candidate
    assert "aim" not in Candidate().to_json()
