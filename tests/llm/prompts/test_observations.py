"""What is seen of one sample, on trajectories made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.model import FunctionModel, ModelInfo, Variable
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.prompts.observations import details, facts, grid_step, monitor_for
from falsifier.llm.prompts.view import View
from falsifier.problem.requirement import Requirement
from falsifier.stl import parse
from falsifier.testing import Array, lag_problem

TIMES = lag_problem().experiment.times


def seen(formula: str, x: NDArray[np.float64]) -> tuple[View, Evaluation]:
    """The lag's outputs replaced by a course of x."""
    problem = lag_problem(formula)
    trajectory = Trajectory(TIMES, {"x": x, "u": 0 * TIMES}, {"x": "m"})
    verdict = monitor_for(View.of(problem)).evaluate(trajectory)
    candidate = Candidate({"u": Signal((0.0,), (0.0,), "constant")})
    return View.of(problem), Evaluation(candidate, "ok", verdict, "", trajectory)


def line(lines: list[str], start: str) -> str:
    (found,) = [each for each in lines if each.startswith(start)]
    return found


def test_it_is_told_why_and_what_all_signals_were_then() -> None:
    lines = list(facts(*seen("G[0,10] (x <= 2)", np.minimum(TIMES / 4, 1.5))))
    assert "x = 1.5" in line(lines, "why: ")
    assert line(lines, "all signals at t = 6 s: ") == "all signals at t = 6 s: x = 1.5 m, u = 0 V"


@pytest.mark.parametrize(
    ("limit", "parts"),
    [
        (11.0, ["always true", "1 at 10 s"]),
        (-2.0, ["never true", "0 s", "2"]),
        (6.0, ["4 s in total", "6.1 to 10 s"]),
    ],
)
def test_of_a_predicate_it_is_told_when_it_was_false(limit: float, parts: list[str]) -> None:
    told = line(list(facts(*seen(f"G[0,10] (x <= {limit:g})", TIMES.copy()))), f"x <= {limit:g}: ")
    assert all(part in told for part in parts), told


def test_both_sides_of_the_connectives_on_the_way_are_told() -> None:
    lines = list(facts(*seen("G[0,10] (x <= 11) and (F[0,10] (x >= 3) or G[0,10] (u >= 1))", TIMES.copy())))
    conjuncts = line(lines, "conjuncts at t = 0 s: ")
    assert "G[0,10] (x <= 11) robustness +1 m" in conjuncts
    assert not [each for each in lines if each.startswith("alternatives")], "the way led to the other side"
    lines = list(facts(*seen("G[0,10] (x <= 99) and (F[0,10] (x >= 3) or G[0,10] (u >= 1))", TIMES.copy())))
    assert "robustness -1 V" in line(lines, "alternatives at t = 0 s: ")


def test_signals_of_few_whole_numbers_are_told_by_their_changes() -> None:
    steps = np.where(TIMES < 4.05, 1.0, 2.0)
    view, evaluation = seen("G[0,10] (x <= 2)", steps)
    assert line(list(facts(view, evaluation)), "x: ") == "x: 1, then 2 from 4.1 s"
    assert not [each for each in details(view, evaluation) if each.startswith("x")]


def test_details_are_values_on_a_grid_and_densely_where_it_was_decided() -> None:
    view, evaluation = seen("G[0,10] (x <= 2)", np.sin(TIMES / 2))
    lines = list(details(view, evaluation))
    coarse, dense = [i for i, each in enumerate(lines) if each.startswith("values every")]
    assert "0.5 s from t = 0:" in lines[coarse]
    assert lines[coarse + 1].count(",") >= 20
    assert "values every 0.1 s from t = 2.1 s:" in lines[dense], "around pi s"


def test_without_a_trajectory_there_is_the_verdict_alone() -> None:
    problem = lag_problem()
    found = evaluate(problem, problem.space.decode([1.0] * 4))
    bare = Evaluation(found.candidate, "ok", found.verdict)
    (only,) = facts(View.of(problem), bare)
    assert "10 s" in only and "x <= 0.9" in only
    assert list(details(View.of(problem), bare)) == []


def test_no_more_signals_than_can_be_read() -> None:
    def many(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> dict[str, Array]:
        return {f"y{i}": np.sin(times + i) for i in range(40)}

    problem = lag_problem()
    names = tuple(f"y{i}" for i in range(40))
    variables = tuple(Variable(n, causality="output") for n in names)
    info = ModelInfo("many", variables=(*problem.info.variables[:1], *variables))
    problem = replace(
        problem,
        model=FunctionModel(many, info),
        requirement=Requirement("MANY", parse("G[0,10] (y7 <= 2)")),
        experiment=replace(problem.experiment, outputs=names),
    )
    lines = list(details(View.of(problem), evaluate(problem, problem.space.decode([0.0] * 4))))
    told = {each.split(":")[0] for each in lines if each.startswith("y")}
    assert len(told) == 16
    assert "y7" in told, "those of the formula come first"


@pytest.mark.parametrize(
    ("stop", "step"), [(50.0, 2.5), (40.0, 2.0), (0.3, 0.02), (1.0, 0.05), (1000.0, 50.0)]
)
def test_the_grid_has_a_round_step_and_at_most_twenty_parts(stop: float, step: float) -> None:
    assert grid_step(stop) == step
    assert stop / grid_step(stop) <= 20
