"""Every engine accepts every formula that the monitor accepts, whichever signals it names."""

from dataclasses import replace

import pytest

from falsifier.core.model import FunctionModel, Variable
from falsifier.engines import ENGINES, make_engine
from falsifier.engines.protocol import Engine
from falsifier.engines.surrogate import Settings
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl import parse
from falsifier.testing import FREE, lag_problem
from tests.engines.support import HASTY

FORMULAS = (
    "G[0,10] (x <= 3 or v >= 1)",
    "F[0,10] (brake > 10 or x <= 100)",
    "G[0,10] (u + brake <= 30)",
    "G[0,10] (u <= 30)",
    "G[0,10] (brake <= 30)",
    "G[0,10] ((v <= 1) -> F[0,0] (locked or w >= 0))",
    "(locked) U[0,5] (x >= 1)",
)


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


def without_outputs(problem: Problem) -> Problem:
    """The same problem with nothing recorded: some formulas name inputs alone."""
    return replace(problem, experiment=replace(problem.experiment, outputs=()))


def make(name: str, problem: Problem) -> Engine:
    options: dict[str, Settings] = {"settings": HASTY} if name == "surrogate" else {}
    return make_engine(name, problem, seed=2, **options)


NAMES = [name for name in ENGINES if name not in ("hybrid", "botorch")]


@pytest.mark.parametrize("formula", FORMULAS)
@pytest.mark.parametrize("name", NAMES)
def test_signals_that_are_not_searched_are_no_obstacle(name: str, formula: str) -> None:
    problem = partly_searched(formula)
    problems = [problem]
    if not {"x"} & set(problem.requirement.formula.signals):
        problems.append(without_outputs(problem))
    for each in problems:
        engine = make(name, each)
        for _ in range(8):
            (candidate,) = engine.ask(1)
            evaluation = evaluate(each, candidate)
            assert evaluation.verdict is not None, evaluation.reason
            engine.tell([evaluation])
