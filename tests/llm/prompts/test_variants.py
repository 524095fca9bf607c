"""What each variant tells, on the transmission and on small problems."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from falsifier.context.values import Compared, Context, Excerpt
from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import Freedom, InputRange, ParameterRange, SearchSpace
from falsifier.core.trajectory import Trajectory
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm import DEFAULT_VARIANT
from falsifier.llm.prompts import VARIANTS, View, build_prompt, render, variant_named
from falsifier.problem.requirement import Requirement
from falsifier.stl import Verdict, parse
from falsifier.testing import lag_problem
from tests.llm.prompts.support import told, transmission


def test_variants_only_add_parts_up_to_mp4() -> None:
    parts = [VARIANTS[f"MP{i}"].parts for i in range(1, 5)]
    assert all(a < b for a, b in pairwise(parts))
    assert variant_named("mp3").name == "MP3"
    assert variant_named(None).name == DEFAULT_VARIANT
    with pytest.raises(SpecError, match="did you mean 'MP5'"):
        variant_named("MP55")


@pytest.mark.parametrize("variant", VARIANTS)
def test_an_empty_history_is_not_described(variant: str) -> None:
    problem, _ = transmission()
    _, changing = told(problem, variant)
    assert changing == "Propose the first sample."


@pytest.mark.parametrize("variant", VARIANTS)
def test_what_a_violation_is_and_ranges_are_told(variant: str) -> None:
    standing, _ = told(transmission()[0], variant)
    assert (
        "> forbids its limit" if variant in ("MP5", "MP6") else "below 0 the specification is violated"
    ) in standing
    assert "from 0 to 325" in standing


class TestMP5:
    """Everything that the model description and the monitor know."""

    def test_system_units_and_meanings(self) -> None:
        standing, _ = told(transmission()[0], "MP5")
        assert "Car with an engine" in standing
        assert "- speed [mph]: " in standing
        assert "- gear, integer: " in standing
        assert "input signal throttle [%]: " in standing
        assert "In words: At all times from 0 to 20 s, speed is at most 120." in standing
        assert "pchip (monotone cubic) interpolation; sampled and held every 0.05 s" in standing

    def test_freedom_is_offered_where_it_is_allowed(self) -> None:
        problem, _ = transmission()
        standing, _ = told(problem, "MP5")
        assert "at most 500, at least 0.1 s apart" in standing
        assert '"times": []' in standing
        fixed = replace(
            problem,
            space=replace(problem.space, inputs=tuple(replace(r, free=None) for r in problem.space.inputs)),
        )
        standing, _ = told(fixed, "MP5")
        assert "Alternatively, choose" not in standing
        assert '"times"' not in standing

    def test_what_decided_and_everything_there(self) -> None:
        problem, evaluation = transmission()
        _, changing = told(problem, "MP5", [evaluation])
        assert "robustness +0.418" in changing
        assert "was lowest at 20 s: speed = 119.581 is below 120" in changing
        assert "all signals at t = 20 s: speed = 119.581 mph, rpm = " in changing
        assert "gear: 1, then 2 from 2.56 s, 3 from 6.16 s, 4 from 12.32 s" in changing
        assert "speed: 0:0 " in changing and "speed around t = 20 s: " in changing
        assert "throttle: pchip, 7 evenly spaced values [100, 100, 100, 0, 0, 0, 0]" in changing
        assert "brake: constant 0" in changing

    def test_conjuncts_and_sides_of_an_implication(self) -> None:
        problem, evaluation = transmission("AT6a")
        _, changing = told(problem, "MP5", [evaluation])
        line = next(x for x in changing.splitlines() if "condition and consequence" in x)
        assert "G[0,30] (rpm <= 3000) robustness -" in line
        assert "rev/min; G[0,4] (speed <= 35) robustness -" in line
        assert line.endswith("mph")

    def test_connectives_inside_a_chain_are_told_too_and_links_of_it_once(self) -> None:
        formula = "G[0,9] (x <= 0.9) and G[0,9] (x <= 0.8) and G[0,9] (x >= 0.1 -> u <= 0.5)"
        problem = lag_problem(formula)
        _, changing = told(problem, "MP5", [evaluate(problem, problem.space.decode([0.8] * 4))])
        (chain,) = (line for line in changing.splitlines() if line.startswith("  conjuncts"))
        assert chain.count("robustness") == 3
        assert "condition and consequence at t = 0.7 s: x >= 0.1 robustness" in changing

    def test_discrete_requirements_get_stays_and_a_flat_robustness_is_said(self) -> None:
        problem, first = transmission("AT51")
        second = evaluate(problem, problem.space.decode((50,) * 7 + (0,) * 3))
        standing, changing = told(problem, "MP5", [first, second])
        assert "gear stays: 1: never entered again" in changing
        assert "The robustness is flat: it was +0.5 in all 2 samples" in changing
        assert "make the condition true first" in standing

    def test_terms_are_signals_of_their_own(self) -> None:
        problem = lag_problem("G[0,10] (abs(x - u) <= 0.9)")
        evaluation = evaluate(problem, problem.space.decode([0, 1, 0, 1]))
        standing, changing = told(problem, "MP5", [evaluation])
        assert "Derived signals, reported below: abs(x - u)" in standing
        assert "\n  abs(x - u): 0:0 " in changing
        assert "abs(x - u) <= 0.9, from 0 to 10 s: always true, smallest margin" in changing

    def test_terms_of_inputs_alone_are_not_said_to_be_reported(self) -> None:
        problem = lag_problem("G[0,10] (abs(x - u) <= 0.9 + 0.1*u)")
        standing, _ = told(problem, "MP5")
        assert "Derived signals, reported below: abs(x - u)\n" in f"{standing}\n"

    def test_that_signals_are_told_up_to_where_the_requirement_looks(self) -> None:
        standing, _ = told(lag_problem("G[0,4] (x <= 0.9)"), "MP5")
        assert "They are told up to 4 s, as the requirement looks no further." in standing
        assert "They are told up to" not in told(lag_problem(), "MP5")[0]

    def test_failed_samples_with_their_reason(self) -> None:
        problem = lag_problem()
        candidate = problem.space.decode([1, 1, 1, 1])
        _, changing = told(problem, "MP5", [Evaluation(candidate, "crashed", reason="division by zero")])
        assert "no verdict, the simulation crashed: division by zero" in changing

    def test_best_and_most_different_beside_the_recent(self) -> None:
        problem = lag_problem()
        points: list[list[float]] = [[-1, -1, -1, 0.1], [0.8] * 4, *([0.01 * i] * 4 for i in range(15))]
        evaluations = [evaluate(problem, problem.space.decode(p)) for p in points]
        _, changing = told(problem, "MP5", evaluations)
        assert "Sample 2 (best so far)" in changing
        assert "Sample 1 (shown because it differs most from the others)" in changing
        shown = [line for line in changing.splitlines() if line.startswith("Sample ")]
        assert len(shown) == 13
        assert "13 of 17" in changing

    def test_parameters_are_plain_numbers(self) -> None:
        problem = lag_problem(
            parameters=(ParameterRange("x0", -0.5, 1 / 3, nominal=0.0, unit="m", description="start"),)
        )
        standing, changing = told(
            problem, "MP5", [evaluate(problem, problem.space.decode([0, 0, 0, 0, 0.25]))]
        )
        assert "- parameter x0 [m]: start; from -0.5 to 0.3333333333, nominally 0; one value" in standing
        assert "x0 = 0.25" in changing

    def test_aliasing_is_said_and_shown_densely(self) -> None:
        problem = lag_problem()
        times = problem.experiment.times
        x = 0.5 * np.sin(2 * np.pi * times / 0.8)
        candidate = problem.space.decode([0, 0, 0, 0])
        trajectory = Trajectory(times, {"x": x, "u": 0 * times})
        verdict = Verdict(0.4, float(times[int(x.argmax())]), "x <= 0.9", {"x": 0.5})
        evaluation = Evaluation(candidate, "ok", verdict, "", trajectory)
        _, changing = told(problem, "MP5", [evaluation])
        assert "oscillates from 0.2 to 9.8 s with period 0.8 s, between" in changing
        fast = {"x": 0.5 * np.sin(2 * np.pi * times / 0.4), "u": 0 * times}
        _, changing = told(problem, "MP5", [replace(evaluation, trajectory=Trajectory(times, fast))])
        assert "oscillates from 0.1 to 9.9 s with period 0.4 s, between" in changing
        assert "\n  x around t = " in changing

    def test_only_parameters(self) -> None:
        problem = lag_problem(parameters=(ParameterRange("x0", -1.0, 1.0),))
        problem = replace(problem, space=SearchSpace((), problem.space.parameters, 10.0))
        standing, _ = told(problem, "MP5")
        assert '"signals"' not in standing
        assert '"parameters": [{"name": "x0", "value": -0.74}]' in standing
        assert "control points" not in standing

    def test_free_signals_are_told_as_they_were_written(self) -> None:
        problem = lag_problem(free=Freedom(400, 0.02))
        pulse = problem.space.admit(Candidate({"u": Signal((0.0, 2.0, 2.5), (0.0, 1.0, 0.0), "constant")}))
        long = problem.space.admit(
            Candidate({"u": Signal.evenly([0.0] * 99 + [1.0], stop_time=10.0, interpolation="constant")})
        )
        _, changing = told(problem, "MP5", [evaluate(problem, c) for c in (pulse, long)])
        assert "u: constant pieces from [time, value] points [[0, 0], [2, 1], [2.5, 0]]" in changing
        assert 'u: constant pieces, 100 evenly spaced values ["0 x 99", 1]' in changing

    def test_whole_numbers_are_asked_for(self) -> None:
        def asked(**changes: Any) -> str:
            problem = lag_problem(limit=2.0)
            (u,) = problem.space.inputs
            space = replace(problem.space, inputs=(replace(u, interpolation="constant", **changes),))
            view = View.of(replace(problem, space=space))
            return render(build_prompt(view, variant_named("MP5"), []))[0].content

        assert "; integers from -1 to 1; " in asked(low=-1.0, high=1.0, kind="integer")
        assert "; Boolean, 0 (false) or 1 (true); " in asked(kind="boolean", low=0.0, high=1.0)
        gears = asked(kind="enumeration", low=1.0, high=2.0, items=(("low", 1), ("top", 2), ("rear", 3)))
        assert "; one of the numbers 1 = low, 2 = top; " in gears
        assert '"values": [1.0, 2.0, 1.0, 2.0]' in gears

    def test_several_candidates_and_pending_ones(self) -> None:
        problem = lag_problem()
        pending = [problem.space.decode([0.5] * 4)]
        prompt = build_prompt(View.of(problem), variant_named("MP5"), [], pending=pending, count=3)
        standing, changing = (m.content for m in render(prompt))
        assert "3 different candidates" in standing
        assert '{"candidates": [{' in standing
        assert "so nothing is known of them:\nu: constant 0.5" in changing
        assert "Propose the next 3 different samples" in changing


def test_requirements_over_inputs_only() -> None:
    problem = lag_problem("G[0,10] (u <= 0.5)")
    for variant in VARIANTS:
        evaluation = evaluate(problem, problem.space.decode([0, 0, 0, 0]))
        assert told(problem, variant, [evaluation])


def test_an_evaluation_without_trajectory_is_told_from_its_verdict() -> None:
    problem = lag_problem()
    evaluation = replace(evaluate(problem, problem.space.decode([0.5] * 4)), trajectory=None)
    for variant in ("MP4", "MP5"):
        _, changing = told(problem, variant, [evaluation])
        assert "robustness 0.400" in changing if variant == "MP4" else "robustness +0.4" in changing
        assert "decided at t = 10" in changing


def test_long_inputs_do_not_fill_the_prompt() -> None:
    space = SearchSpace((InputRange("u", -1.0, 1.0, control_points=400, interpolation="constant"),), (), 10.0)
    problem = replace(lag_problem(), space=space, requirement=Requirement("R", parse("G[0,10] (x <= 0.9)")))
    standing, _ = told(problem, "MP5")
    assert "400 control points every 0.025 s from t = 0" in standing


def test_context_makes_mp6_the_default() -> None:
    assert variant_named(None).name == "MP5"
    assert variant_named(None, has_context=True).name == "MP6"
    assert variant_named("mp4", has_context=True).name == "MP4"
    assert VARIANTS["MP6"].parts - VARIANTS["MP5"].parts == {"context"}


def test_only_mp6_tells_context() -> None:
    excerpt = Excerpt("/home/me/a.md", "a.md", "0" * 64, "whole", "THE TEXT")
    compared = (Compared(("x",), "x > 3", "a:1"), Compared(("u",), "u < 1", "a:2"), Compared((), "z < 2", ""))
    view = replace(View.of(lag_problem()), context=Context((excerpt,), compared))
    standing = {name: render(build_prompt(view, v, []))[0].content for name, v in VARIANTS.items()}
    assert [name for name, text in standing.items() if "THE TEXT" in text] == ["MP6"]
    for part in (
        "; in the files below: x > 3",
        "; in the files below: u < 1",
        "--- a.md (whole) ---\nTHE TEXT\n--- end of the files ---",
        "Other comparisons with constants in them: z < 2",
    ):
        assert part in standing["MP6"]
    bare = render(build_prompt(replace(view, context=Context()), VARIANTS["MP6"], []))
    assert bare[0].content == standing["MP5"]
