from dataclasses import replace

from falsifier.llm.prompts.view import View
from falsifier.problem.loading import load_problem
from falsifier.testing import lag_problem


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
