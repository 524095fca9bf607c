from dataclasses import replace

from falsifier.core.model import ModelInfo, Variable
from falsifier.evaluation.evaluate import evaluate
from falsifier.llm.prompts.view import View
from falsifier.problem.loading import load_problem
from falsifier.testing import lag_problem
from tests.llm.prompts.support import told as told_of


def test_a_view_holds_everything_but_what_simulates() -> None:
    problem = lag_problem()
    view = View.of(problem)
    assert (view.info, view.requirement, view.space, view.experiment) == (
        problem.info,
        problem.requirement,
        problem.space,
        problem.experiment,
    )
    assert not any(value is problem.model for value in (getattr(view, name) for name in View.__slots__))


def test_units_descriptions_and_types_by_name() -> None:
    view = View.of(load_problem("AT1"))
    assert (view.unit("speed"), view.kind("speed"), view.description("speed")) == (
        "mph",
        "real",
        "Vehicle speed",
    )
    assert view.kind("gear") == "integer"
    assert (view.unit("nobody"), view.kind("nobody"), view.description("nobody")) == ("", "real", "")


def test_the_formulas_outputs_are_its_signals_that_are_not_searched() -> None:
    problem = lag_problem("G[0,10] (u + x <= 3 and v >= x)", inputs=2)
    partly = replace(problem, space=replace(problem.space, inputs=problem.space.inputs[:1]))
    assert View.of(partly).formula_outputs == ("x", "v")


def test_items_of_an_enumeration_are_named_wherever_its_values_are_told() -> None:
    problem = lag_problem("G[0,10] (x <= 0.9)")
    mode = Variable("x", kind="enumeration", literals={"Idle": 0, "Run": 1})
    view = View.of(problem)
    view = replace(view, info=ModelInfo("m", variables=(mode,)))
    assert view.items("x") == ("0 = Idle", "1 = Run") and view.items("other") == ()
    assert view.labelled("x", 1.0, "1") == "1 (Run)" and view.labelled("x", 7.0, "7") == "7"
    evaluation = evaluate(problem, problem.space.decode([0] * 4))
    assert evaluation.trajectory is not None
    steps = (evaluation.trajectory.times >= 5).astype(float)
    told = replace(
        evaluation, trajectory=replace(evaluation.trajectory, columns={"x": steps, "u": 0 * steps})
    )
    standing, changing = told_of(view, "MP5", [told], start={"x": (0.0, 0.0)})
    assert "- x, 0 = Idle, 1 = Run; at t = 0: 0 (Idle)" in standing
    assert "x: 0 (Idle), then 1 (Run) from 5 s" in changing
    assert (
        "x stays: 0 (Idle): never entered again; 1 (Run): entered at 5 s and still held at 10 s" in changing
    )
