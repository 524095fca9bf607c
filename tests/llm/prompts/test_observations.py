"""What is seen of one sample, on trajectories made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.experiment import Experiment
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.engines import make_engine
from falsifier.evaluation.evaluate import Evaluation, compiled, evaluate, monitor_for
from falsifier.llm.prompts.observations import observed
from falsifier.llm.prompts.view import View
from falsifier.testing import lag_problem

TIMES = lag_problem().experiment.times


def seen(formula: str, x: NDArray[np.float64]) -> tuple[View, Evaluation]:
    """The lag's outputs replaced by a course of x."""
    problem = lag_problem(formula)
    trajectory = Trajectory(TIMES, {"x": x, "u": 0 * TIMES}, {"x": "m"})
    verdict = monitor_for(problem).evaluate(trajectory)
    candidate = Candidate({"u": Signal((0.0,), (0.0,), "constant")})
    return View.of(problem), Evaluation(candidate, "ok", verdict, "", trajectory)


def facts(view: View, evaluation: Evaluation) -> list[str]:
    return list(observed(view, evaluation).full)


def courses(view: View, evaluation: Evaluation) -> list[str]:
    """The lines on x over time."""
    return [each for each in facts(view, evaluation) if each.startswith(("x: ", "x around"))]


def line(lines: list[str], start: str) -> str:
    (found,) = [each for each in lines if each.startswith(start)]
    return found


def test_it_is_told_why_and_what_all_signals_were_then() -> None:
    lines = facts(*seen("G[0,10] (x <= 2)", np.minimum(TIMES / 4, 1.5)))
    assert "x = 1.5" in line(lines, "why: ")
    assert line(lines, "all signals at t = 6 s: ") == "all signals at t = 6 s: x = 1.5 m, u = 0 V"


def test_numbers_without_a_unit_have_none_though_the_fmu_calls_it_one() -> None:
    view, evaluation = seen("G[0,10] (x <= 2 and u <= 1)", np.minimum(TIMES / 4, 1.5))
    variables = tuple(replace(v, unit="1") for v in view.info.variables)
    lines = facts(replace(view, info=replace(view.info, variables=variables)), evaluation)
    assert line(lines, "all signals at t = 6 s: ").endswith(": x = 1.5, u = 0")
    assert line(lines, "conjuncts").endswith("x <= 2 robustness +0.5; u <= 1 robustness +1")


def test_times_of_microseconds_are_told_apart() -> None:
    problem = lag_problem("G[0,1e-5] (x <= 0.755 and u <= 1)")
    space, grid = replace(problem.space, stop_time=1e-5), Experiment(1e-5, 1e-7, ("x",))
    view = replace(View.of(problem), space=space, experiment=grid)
    times = view.experiment.times
    x = np.minimum(times * 1e5, 0.8)
    trajectory = Trajectory(times, {"x": x, "u": 0 * x})
    verdict = compiled(view.requirement.formula, 1e-7, 101).evaluate(trajectory)
    candidate = Candidate({"u": Signal((0.0,), (0.0,), "constant")})
    lines = facts(view, Evaluation(candidate, "ok", verdict, "", trajectory))
    assert line(lines, "all signals at t = 8e-06 s: ")
    assert line(lines, "x <= 0.755, ").endswith("false only from 7.6e-06 to 1e-05 s")
    around = line(lines, "x around t = ").partition(" s: ")[2].split()
    assert len({point.partition(":")[0] for point in around}) == len(around) > 2


def test_what_broke_is_told_before_the_condition_that_decided() -> None:
    lines = facts(*seen("G[0,10] (x >= 5 -> u >= 3)", np.minimum(TIMES, 5.5)))
    assert lines[0].startswith("what broke: u >= 3 was violated from 5")
    assert "while x >= 5 held (x = 5" in lines[0]
    assert lines[1].startswith("why: ") and lines[1].endswith("x = 5.5 exceeds 5.")


@pytest.mark.parametrize(
    ("limit", "told"),
    [
        ("x >= -1", "always true, smallest margin 1 at 0 s"),
        ("x <= -2", "never true, closest at 0 s, off by 2"),
        ("x <= 6", "false only from 6.1 to 10 s"),
        ("x != 4", "false only at 4 s"),
        ("x > 0", "false only at 0 s"),
        ("x < 10", "false only at 10 s"),
    ],
)
def test_of_a_predicate_it_is_told_when_it_was_false(limit: str, told: str) -> None:
    lines = facts(*seen(f"G[0,10] ({limit} and u >= 5)", TIMES.copy()))
    assert line(lines, f"{limit}, from 0 to 10 s: ").endswith(told)


def test_of_a_predicate_nothing_is_told_of_times_at_which_it_does_not_count() -> None:
    x = np.where((TIMES >= 2) & (TIMES <= 8), 1.0, 0.0)
    lines = facts(*seen("G[0,3] (x <= 0.5) and G[7,10] (x <= 0.5) and u <= 9", x + 0.1))
    told = "false for about 2.2 s in total, longest from 2 to 3 s"
    assert line(lines, "x <= 0.5, ") == f"x <= 0.5, from 0 to 10 s where it counts: {told}"


def test_when_something_was_false_first_is_told_where_another_time_was_longer() -> None:
    x = np.where((np.abs(TIMES - 2.5) < 0.6) | (TIMES >= 7), 1.0, 0.0)
    lines = facts(*seen("G[0,10] (x <= 0.5 and u <= 1)", x + TIMES / 100))
    assert line(lines, "x <= 0.5, ").endswith("in total, first at 1.9 s, longest from 7 to 10 s")


def test_a_condition_that_was_never_true_is_told_once() -> None:
    both = "(x > 5 -> u <= 1) and (x > 5 -> u <= 2)"
    lines = facts(*seen(f"G[0,10] ({both})", np.minimum(TIMES / 4, 1.5)))
    assert line(lines, "why: ").endswith("It is the condition of 1 other implication, too.")
    lines = facts(*seen("G[0,10] (x > 5 -> u <= -1)", 0 * TIMES))
    assert not [each for each in lines if each.startswith(("condition", "nearest"))], "the same at all times"


def test_both_sides_of_the_connectives_on_the_way_are_told() -> None:
    lines = facts(*seen("G[0,10] (x <= 11) and (F[0,10] (x >= 3) or G[0,10] (u >= 1))", TIMES.copy()))
    assert "G[0,10] (x <= 11) robustness +1 m" in line(lines, "conjuncts at t = 0 s: ")
    assert not [each for each in lines if each.startswith("alternatives")], "the way led to the other side"
    lines = facts(*seen("G[0,10] (x <= 99) and (F[0,10] (x >= 3) or G[0,10] (u >= 1))", TIMES.copy()))
    assert "robustness -1 V" in line(lines, "alternatives at t = 0 s: ")


def test_around_the_longest_failure_of_what_must_recur_courses_are_more_exact() -> None:
    failing = np.where((TIMES >= 3) & (TIMES <= 5), 0.2 * np.sin(TIMES) + TIMES / 10, 2 + TIMES / 10)
    _, around = courses(*seen("G[0,7] F[0,3] (x >= 1)", failing))
    assert around.startswith("x around the longest failure, from 3 to 5 s: 2.6:2.26 ")


def test_courses_are_breakpoints_and_more_exact_ones_where_it_was_decided() -> None:
    view, evaluation = seen("G[0,10] (x <= 2)", np.sin(TIMES / 2))
    over_time, around = courses(view, evaluation)
    assert over_time.startswith("x: 0:0 ") and over_time.endswith(" 10:-0.96")
    assert around.startswith("x around t = 3.1 s: 2.7:0.97") and " 3.1:0.9997" in around
    short = line(list(observed(view, evaluation).short), "x: ")
    assert short.startswith("x: 0:0 ") and len(short) <= len(over_time)


def test_however_many_signals_are_discrete_others_are_told_over_time() -> None:
    view, evaluation = seen("G[0,10] (x <= 2)", np.sin(TIMES / 2))
    assert evaluation.trajectory is not None
    columns = {**{f"b{k}": np.where(k / 4 < TIMES, 1.0, 0.0) for k in range(20)}, "z": TIMES.copy()}
    view = replace(view, experiment=replace(view.experiment, outputs=("x", *columns)))
    trajectory = Trajectory(TIMES, {**evaluation.trajectory.columns, **columns})
    lines = facts(view, replace(evaluation, trajectory=trajectory))
    assert line(lines, "b19: ") == "b19: 0, then 1 from 4.8 s" and line(lines, "z: ") == "z: 0:0 10:10"


def test_a_ripple_beside_the_threshold_is_told_although_it_is_small() -> None:
    jump = np.where(TIMES < 1, 5.0 * (1 - TIMES), 0.0) + 0.034 * (TIMES > 6) * np.sin(TIMES * np.pi)
    over_time, _ = courses(*seen("G[2,10] (x <= 0.035)", jump))
    assert "0.03" in over_time, "2 % of the span would be 0.1"


def test_a_predicate_is_judged_only_when_the_requirement_asks_for_it() -> None:
    told = line(facts(*seen("G[2,5] (x <= 6 and u >= 3)", TIMES.copy())), "x <= 6")
    assert told == "x <= 6, from 2 to 5 s: always true, smallest margin 1 at 5 s"


def test_courses_and_changes_end_where_the_requirement_stops_looking() -> None:
    steps = (TIMES > 2) * 1.0 + (TIMES > 4.05) - (TIMES > 5.05) + 8 * (TIMES > 7)
    lines = facts(*seen("G[0,3] F[0,3] (x <= 19)", steps))
    assert line(lines, "x: ") == "x: 0, then 1 from 2.1 s, 2 from 4.1 s, 1 from 5.1 s"
    assert line(lines, "x stays: ") == "x stays: 2 times at 1, the shortest for 2 s from 2.1 s"
    over_time, around = courses(*seen("G[2,6] (x <= 9)", TIMES.copy()))
    assert (over_time, around.split()[-1]) == ("x: 0:0 6:6", "6:6")
    (only,) = courses(*seen("x <= 9", TIMES.copy()))
    assert only == "x: constant 0"


def test_the_time_that_decided_is_left_out_where_all_times_would_have() -> None:
    view, evaluation = seen("G[0,10] (x <= 2)", np.ones_like(TIMES))
    assert facts(view, evaluation) == [
        "why: x = 1 is below 2 at all times.",
        "x: constant 1",
    ]
    assert not observed(view, evaluation).signs.is_timed
    (why,) = [t for t in facts(*seen("x <= 2 or G[1,2] (x >= 9)", TIMES / 5)) if t.startswith("why: ")]
    assert "x = 0 is below 2" in why and "at all times" not in why
    assert observed(*seen("G[0,10] (x <= 9)", TIMES.copy())).signs.is_timed


def test_a_line_tells_the_margins_of_the_parts() -> None:
    told = observed(*seen("G[0,10] (x <= 12) or G[0,10] (x <= 9)", TIMES.copy()))
    assert told.line == "decided at t = 10 s by x <= 12; alternatives +2, -1"


@pytest.mark.parametrize(("jumps", "is_told"), [(5, False), (30, True)])
def test_when_a_discrete_signal_was_beyond_its_limit_is_told_unless_its_changes_show_it(
    jumps: int, *, is_told: bool
) -> None:
    lines = facts(*seen("G[0,10] (u <= 1 and x <= 0.5)", np.floor(TIMES * jumps / 10) % 2))
    assert any(each.startswith("x <= 0.5, from 0") for each in lines) is is_told


def test_without_a_trajectory_there_is_the_verdict_alone() -> None:
    problem = lag_problem()
    found = evaluate(problem, problem.space.decode([1.0] * 4))
    bare = Evaluation(found.candidate, "ok", found.verdict)
    assert facts(View.of(problem), bare) == ["decided at t = 10 s by x <= 0.9"]
    assert observed(View.of(problem), found).line == "decided at t = 10 s by x <= 0.9"


def test_a_part_that_has_no_value_where_it_does_not_matter_is_told_where_it_does() -> None:
    problem = lag_problem("G[0,0.5] (sqrt(x + 0.2) <= 9 or x >= 0) and x <= 3")
    engine, view = make_engine("corners", problem, seed=0), View.of(problem)
    seen = [evaluate(problem, *engine.ask()) for _ in range(12)]
    judged = [e for e in seen if e.trajectory is not None]
    assert any((e.trajectory["x"] < -0.2).any() for e in judged if e.trajectory is not None)
    for evaluation in judged:
        assert any("sqrt(x + 0.2) <= 9, from 0 to 0.5 s" in line for line in observed(view, evaluation).full)


@pytest.mark.parametrize(
    ("term", "is_told"), [("abs(x)", False), ("abs(x - 0.5)", False), ("abs(x*x - 0.5)", True)]
)
def test_of_an_absolute_value_the_course_of_the_signal_is_told(term: str, *, is_told: bool) -> None:
    swings = observed(*seen(f"G[0,10] ({term} <= 2)", np.sin(TIMES)))
    for lines in (swings.full, swings.short):
        assert any(each.startswith("abs(") and ": 0:" in each for each in lines) == is_told
    assert any(each.startswith("x: ") for each in swings.full)
    assert any(each.startswith("x: ") for each in swings.short) != is_told


def test_a_signal_is_told_as_exactly_where_what_it_is_compared_with_has_no_value() -> None:
    x = np.linspace(-0.5, 0.4, 101)  # no root of it is real before 5.6 s, where nobody asks for one
    (told, *_) = courses(*seen("G[7,10] (x <= 2*sqrt(x))", x))
    assert told == "x: 0:-0.5 10:0.4"


def test_a_late_critical_time_is_told_exactly_in_one_line() -> None:
    problem = lag_problem("G[0,200000] (x <= 9)")
    space = replace(problem.space, stop_time=200_000.0)
    long = replace(problem, experiment=Experiment(200_000.0, 1.0, ("x",)), space=space)
    times = long.experiment.times
    trajectory = Trajectory(times, {"x": np.exp(-(((times - 123_457) / 1e4) ** 2)), "u": 0 * times})
    verdict = monitor_for(long).evaluate(trajectory)
    made = Evaluation(Candidate({"u": Signal((0.0,), (0.0,), "constant")}), "ok", verdict, "", trajectory)
    assert observed(View.of(long), made).line.startswith("decided at t = 123457 s by x <= 9")
