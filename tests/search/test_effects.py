from falsifier import Candidate, Signal, evaluate
from falsifier.problem.problem import Problem
from falsifier.record.run import falsify
from falsifier.search.vacuity import Effects
from falsifier.testing import Array, lag, lag_problem


def deaf(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> dict[str, Array]:
    """Respond to u alone."""
    return {"x": lag(times, {"u": inputs["u"]}, {})["x"]}


def seen(problem: Problem, *pairs: tuple[float, float]) -> list[str]:
    effects = Effects(problem)
    for u, v in pairs:
        candidate = Candidate({"u": Signal((0.0,), (u,)), "v": Signal((0.0,), (v,))})
        evaluation = evaluate(problem, candidate)
        assert evaluation.trajectory is not None
        effects.see(candidate, evaluation.trajectory)
    return [finding.text for finding in effects.findings()]


def test_an_input_that_changes_nothing_by_itself_is_told() -> None:
    problem = lag_problem("G[0,10] (x <= 2)", inputs=2, response=deaf)
    assert seen(problem, (0.5, 0.0), (0.5, 1.0), (0.2, 0.0)) == [
        "v had no effect on x: the same in 2 simulations that differ in it alone."
    ]


def test_inputs_that_differ_together_show_nothing() -> None:
    assert not seen(lag_problem("G[0,10] (x <= 2)", inputs=2, response=deaf), (0.5, 0.0), (0.2, 1.0))


def test_one_effect_is_enough() -> None:
    problem = lag_problem("G[0,10] (x <= 2)", inputs=2)
    assert not seen(problem, (0.5, 0.0), (0.5, 1.0))


def test_an_input_that_the_formula_names_has_an_effect_on_it() -> None:
    problem = lag_problem("G[0,10] (x <= v + 3)", inputs=2, response=deaf)
    assert not seen(problem, (0.5, 0.0), (0.5, 1.0))


def test_the_result_of_a_search_tells_it() -> None:
    result = falsify(lag_problem("G[0,10] (x <= 2)", inputs=2, response=deaf), "corners", budget=6)
    (found,) = [f for f in result.findings if f.kind == "effect"]
    assert found.part == "v" and not found.vacuous
