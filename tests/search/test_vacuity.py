from pathlib import Path

import pytest

from falsifier import Candidate, ParameterRange, Signal, evaluate
from falsifier.campaigns.analysis import load_run
from falsifier.core.files import bundled
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.record.run import falsify, resume
from falsifier.search.events import Evaluated, Event
from falsifier.search.findings import Finding
from falsifier.search.vacuity import Effects
from falsifier.testing import Array, lag, lag_problem
from falsifier.views.report import html_report, markdown_report
from falsifier.views.text import result_json, result_text, results_text
from tests.problems import still
from tests.searches import stop_after


def findings(problem: Problem, budget: int = 5) -> list[Finding]:
    result = falsify(problem, "uniform", budget=budget)
    assert not result.falsified
    return [f for f in result.findings if f.kind not in ("parameterization", "effect", "margin")]


def test_a_condition_that_never_held_is_told_with_how_close_it_came() -> None:
    problem = lag_problem("G[0,10] (x >= 2 -> u <= 0)")
    (found,) = findings(problem)
    best = max(
        (evaluation.trajectory["x"].max(), i)
        for i, evaluation in enumerate(simulations(problem, 5))
        if evaluation.trajectory is not None
    )
    assert found.kind == "condition"
    assert found.part == "x >= 2"
    assert found.margin == pytest.approx(2 - best[0])
    assert found.simulation == best[1] + 1
    assert found.text.startswith(
        "The condition x >= 2 never held in 5 simulations, so x >= 2 -> u <= 0 was not tested. "
        f"It must hold at some time; at the closest, x reached {best[0]:.6g} (simulation {best[1] + 1}, "
    )


def simulations(problem: Problem, budget: int) -> list[Evaluation]:
    seen: list[Event] = []
    falsify(problem, "uniform", budget=budget, listeners=[seen.append])
    return [event.evaluation for event in seen if isinstance(event, Evaluated)]


def test_a_condition_that_held_in_one_simulation_is_no_finding() -> None:
    assert not findings(lag_problem("G[0,10] (x >= 0.3 -> x <= 1)"), budget=20)


def test_a_disjunct_that_always_held_is_told() -> None:
    found = findings(lag_problem("G[0,10] (x <= 1.5 or u <= 0)"))
    assert [(f.kind, f.part) for f in found] == [("disjunct", "x <= 1.5")]
    assert (
        "always held in 5 simulations, so the other side of x <= 1.5 or u <= 0 was not tested"
        in found[0].text
    )


def test_a_predicate_far_from_its_threshold_is_told() -> None:
    (found,) = findings(lag_problem("G[0,10] (x <= 50)"))
    assert (found.kind, found.part) == ("threshold", "x <= 50")
    assert "was never near its threshold in 5 simulations" in found.text
    assert not findings(lag_problem("G[0,10] (x <= 1.5)"))
    assert not findings(lag_problem("1 <= 20")), "no simulation could come nearer"


def test_a_requirement_that_nothing_moves_is_told() -> None:
    problem = lag_problem("G[0,10] (x <= 0.1)", response=still)
    (found,) = findings(problem)
    assert found.kind == "constant"
    assert found.text.startswith(
        "Nothing that was searched had an effect on x: the same in 5 simulations, with robustness +0.1."
    )
    assert "constant" not in [f.kind for f in findings(problem, budget=1)], "one simulation is too few"


def test_a_robustness_that_does_not_change_is_told_although_signals_do() -> None:
    # Decided by x(0), which no input changes.
    found = findings(lag_problem("G[0,10] (x <= 5 or x >= 9) and G[0,0] (x <= 0.5)"))
    assert "constant" in [f.kind for f in found]
    assert "although x changed" in found[0].text


def test_a_boolean_that_hides_the_margin_is_told() -> None:
    problem = Problem.from_fmu(
        bundled("fmus/HeaterLimpHome.fmu"), "G[0,9] not limp", inputs={"disagreement": (0, 5)}
    )
    told = {f.kind: f.text for f in falsify(problem, "uniform", budget=3).findings}["margin"]
    assert told.startswith("The robustness has few values, because limp is Boolean")
    assert "compare the numbers of which limp is made instead (the model has temperature and" in told


def test_a_falsified_requirement_has_no_findings() -> None:
    result = falsify(lag_problem("G[0,10] ((x >= 2 -> u <= 0) and x <= 0.1)"), "corners", budget=5)
    assert result.falsified
    assert not result.findings


def test_a_resumed_run_finds_the_same(tmp_path: Path) -> None:
    problem = lag_problem("G[0,10] (x >= 2 -> u <= 0)")
    falsify(problem, "uniform", budget=5, directory=tmp_path / "a", listeners=stop_after(3))
    (resumed,) = resume(tmp_path / "a", problems=[problem])
    assert resumed.findings == falsify(problem, "uniform", budget=5).findings


def test_findings_are_on_the_terminal_in_json_and_in_reports(tmp_path: Path) -> None:
    problem = lag_problem("G[0,10] (x >= 2 -> u <= 0)")
    result = falsify(problem, "uniform", budget=5, directory=tmp_path)
    text = result.findings[0].text
    assert f"  note           {text}" in result_text(result)
    assert text in results_text([result])
    assert result_json(result)["findings"][0]["simulation"] == result.findings[0].simulation
    assert result_json(result)["parameterization"] == "fixed"
    assert load_run(tmp_path).findings == result.findings
    assert "What this does not show" in markdown_report(tmp_path)
    assert "The condition x &gt;= 2 never held" in html_report(tmp_path)


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


def test_minus_one_is_not_minus_two() -> None:
    problem = lag_problem("G[0,10] (x <= 2)", inputs=2, limit=2.0, response=deaf)
    assert seen(problem, (0.5, -1.0), (0.5, -2.0)), "v alone differs"
    assert not seen(problem, (-1.0, 0.5), (-2.0, 1.0)), "both differ"


def test_inputs_that_differ_together_or_have_any_effect_are_no_finding() -> None:
    problem = lag_problem("G[0,10] (x <= 2)", inputs=2, response=deaf)
    assert not seen(problem, (0.5, 0.0), (0.2, 1.0))
    assert not seen(lag_problem("G[0,10] (x <= 2)", inputs=2), (0.5, 0.0), (0.5, 1.0))
    named = lag_problem("G[0,10] (x <= v + 3)", inputs=2, response=deaf)
    assert not seen(named, (0.5, 0.0), (0.5, 1.0)), "the formula names v"


@pytest.mark.parametrize("starts", [(), (ParameterRange("x", 0.0, 0.0),)])
def test_the_result_of_a_search_tells_it(starts: tuple[ParameterRange, ...]) -> None:
    problem = lag_problem("G[0,10] (x <= 2)", inputs=2, parameters=starts, response=deaf)
    result = falsify(problem, "corners", budget=6)
    (found,) = [f for f in result.findings if f.kind == "effect"]
    assert found.part == "v"
