"""Engines by name; each goes on whatever the formula names and whatever numbers a model puts out."""

import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from falsifier.core.function_model import FunctionModel
from falsifier.core.model import Variable
from falsifier.core.ranges import ParameterRange
from falsifier.engines import ENGINES, make_engine
from falsifier.engines.protocol import Engine
from falsifier.engines.surrogate import Settings
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.record.run import falsify
from falsifier.stl import parse
from falsifier.testing import FREE, START, Array, EngineContract, Response, drive, lag, lag_problem
from tests.engines.support import HASTY
from tests.problems import Columns, decades, still, straight

NAMES = [name for name in ENGINES if name != "hybrid"]
FORMULAS = (
    "G[0,10] (x <= 3 or v >= 1)",
    "F[0,10] (brake > 10 or x <= 100)",
    "G[0,10] (u + brake <= 30)",
    "G[0,10] (u <= 30)",
    "G[0,10] (brake <= 30)",
    "G[0,10] ((v <= 1) -> F[0,0] (locked or w >= 0))",
    "(locked) U[0,5] (x >= 1)",
)


def make(name: str, problem: Problem, seed: int = 2) -> Engine:
    options: dict[str, Settings] = {"settings": HASTY} if name == "surrogate" else {}
    return make_engine(name, problem, seed=seed, **options)


class TestContract(EngineContract):
    @pytest.fixture(autouse=True, params=NAMES)
    def _named(self, request: pytest.FixtureRequest) -> None:
        self.engine = str(request.param)

    def make(self, problem: Problem, seed: int) -> Engine:
        return make(self.engine, problem, seed)


@pytest.mark.parametrize("name", NAMES)
def test_every_engine_is_registered_by_its_name_and_as_free_if_it_chooses_control_points(name: str) -> None:
    problem = lag_problem(free=FREE)
    engine = make(name, problem)
    chosen = {c.signals["u"].times for c in drive(engine, partial(evaluate, problem), rounds=10)}
    own = {problem.space.fixed_times(problem.space.inputs[0])}
    assert (engine.name, ENGINES[name].is_free) == (name, chosen != own)


@pytest.mark.parametrize("name", NAMES)
def test_a_range_in_decades_is_searched_as_its_exponents_are(name: str) -> None:
    never = "G[0,10] (x <= 3 or x >= -4)"
    bias = ParameterRange("bias", -7.0, 0.0)
    exponents = lag_problem(never, parameters=[bias], response=straight)
    asked, expected = (
        [c.parameters["bias"] for c in drive(make(name, each), partial(evaluate, each), rounds=20)]
        for each in (decades(never, inputs=1), exponents)
    )
    assert np.log10(asked) == pytest.approx(np.array(expected), abs=1e-6)
    assert len(set(asked)) > 2


def test_a_violation_within_half_a_decade_is_found_in_few_simulations() -> None:
    for engine, most in (("surrogate", 10), ("cma", 60)):
        for seed in range(3):
            result = falsify(decades(), engine, budget=most, seed=seed)
            assert result.falsified, (engine, seed)


def test_an_absent_package_is_an_error_with_the_command_that_brings_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    monkeypatch.delitem(sys.modules, "falsifier.engines.optimisers.optuna_tpe", raising=False)
    with pytest.raises(SpecError, match=r"'optuna' needs a package.*pip install 'falsifier\[optuna\]'"):
        make_engine("optuna", lag_problem(), seed=0)


def test_a_wrong_name_nothing_to_vary_and_no_adviser_are_errors() -> None:
    with pytest.raises(SpecError, match="did you mean 'optuna'"):
        make_engine("optna", lag_problem(), seed=0)
    with pytest.raises(SpecError, match="nothing to search"):
        make_engine("uniform", lag_problem(inputs=0), seed=0)
    with pytest.raises(SpecError, match="llm=NAME"):
        make_engine("hybrid", lag_problem(), seed=0)


def partly_searched(formula: str) -> Problem:
    """u is searched; v and w are kept constant, brake and locked at their start values."""
    problem = lag_problem(inputs=3, free=FREE)
    assert isinstance(problem.model, FunctionModel)
    held = (
        Variable("brake", causality="input", start=20.0),
        Variable("locked", kind="boolean", causality="input", start=1.0),
    )
    info = replace(problem.model.info, variables=(*problem.model.info.variables, *held))
    return replace(
        problem,
        model=replace(problem.model, info=info),
        requirement=Requirement("partly", parse(formula)),
        space=replace(problem.space, inputs=problem.space.inputs[:1]),
        parameters={"v": 2.0, "w": 0.5},
    )


@pytest.mark.parametrize("formula", FORMULAS)
@pytest.mark.parametrize("name", NAMES)
def test_signals_that_are_not_searched_are_no_obstacle(name: str, formula: str) -> None:
    problem = partly_searched(formula)
    problems = [problem]
    if "x" not in problem.requirement.formula.signals:  # of inputs alone: nothing need be recorded
        problems.append(replace(problem, experiment=replace(problem.experiment, outputs=())))
    for each in problems:
        for candidate in drive(make(name, each), partial(evaluate, each), rounds=8):
            evaluation = evaluate(each, candidate)
            assert evaluation.verdict is not None, evaluation.reason


def at_the_ends(times: Array, inputs: Columns, parameters: dict[str, float]) -> Mapping[str, Array]:
    return {"x": 1.7e308 * np.sign(lag(times, inputs, parameters)["x"])}


def with_spikes(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    x = lag(times, inputs, parameters)["x"].copy()
    x[len(x) // 2] = 10.0 ** (300.0 * np.sin(1e6 * x[-1]))
    return {"x": x}


def often_failing(times: Array, inputs: Columns, parameters: dict[str, float]) -> Mapping[str, Array]:
    x = lag(times, inputs, parameters)["x"]
    if int(abs(x[-1]) * 1e6) % 2:
        raise ValueError("it cannot be solved")
    return {"x": x}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("response", [still, at_the_ends, with_spikes, often_failing])
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("formula", ["G[0,10] (x <= 3)", "G[0,10] (x <= 3) or F[0,10] (x >= 9)"])
def test_no_number_ends_a_search_or_warns(formula: str, name: str, response: Response) -> None:
    problem = lag_problem(formula, free=FREE, points=2, parameters=[START], response=response)
    assert len(drive(make(name, problem), partial(evaluate, problem), rounds=12)) == 12
