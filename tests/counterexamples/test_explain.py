from collections.abc import Mapping
from dataclasses import replace

import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Freedom, ParameterRange
from falsifier.core.signals import Signal
from falsifier.counterexamples.explain import explain
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import evaluate
from falsifier.testing import Array, lag_problem
from tests.problems import Columns, broken, conditional, decades

FREE = Freedom(10, 0.1)
X0 = ParameterRange("x0", -1.0, 1.0, nominal=0.0)


def test_of_each_part_is_said_what_resetting_it_alone_comes_to_and_no_more() -> None:
    problem = lag_problem(parameters=(X0,))
    explanation = explain(problem, evaluate(problem, problem.space.decode([1.0] * 4 + [0.5])))
    effects = {e.name: e for e in explanation.effects if e.span is None}
    assert effects["u"].is_rest and not effects["u"].violated
    # At rest x falls from 0.5 to 0: the margin is smallest at the start.
    assert effects["u"].robustness == pytest.approx(0.4)
    assert effects["x0"].violated
    assert "LAG requires: At all times from 0 to 10 s, x is at most 0.9." in explanation.text
    told = (
        "With u at rest (0 V) alone: +0.4, not violated. "
        "With x0 at its nominal value (0) alone: -0.09997, still violated. "
        "Each was reset alone; several at once were not tried."
    )
    assert explanation.text.endswith(told)
    assert explanation.diagnosis.critical_time == 10.0


def test_the_middle_of_a_range_in_decades_is_one_of_its_decades() -> None:
    text = explain(decades(), evaluate(decades(), Candidate({}, {"bias": 2e-5}))).text
    assert "With bias at the middle of its range in decades (0.0003162) alone: +1.0" in text


def test_what_broke_comes_first_and_then_what_decided() -> None:
    problem = conditional()
    text = explain(problem, evaluate(problem, problem.space.decode([0.95] * 4))).text
    told = (
        "What broke: x <= 0.5 was violated from ",
        "; while u >= 0.9 held (u = 0.95 V at 10 s).",
        "is -0.05, decided by u >= 0.9 at ",
        "With u at rest (0 V) alone: +0.9, not violated.",
    )
    places = [text.index(part) for part in told]
    assert places == sorted(places)
    assert "several at once" not in text, "there is only one"


def test_of_a_signal_the_stretches_that_count_are_named() -> None:
    problem = lag_problem("G[9,10] (x <= 0.9)", free=FREE)
    signal = Signal((0.0, 2.0, 5.0), (-1.0, 0.5, 1.0), "constant")
    explanation = explain(problem, evaluate(problem, Candidate({"u": signal})))
    spans = {e.span: e.violated for e in explanation.effects if e.span is not None}
    assert spans == {(0.0, 2.0): True, (2.0, 5.0): True, (5.0, 10.0): False}
    assert "With u at rest (0 V) from 5 to 10 s alone: +" in explanation.text
    assert "from 2 to 5 s" not in explanation.text
    held = replace(problem.space.inputs[0], hold=3.0)
    problem = replace(problem, space=replace(problem.space, inputs=(held,)))
    signal = Signal((0.0, 2.0, 5.0, 9.5), (-1.0, 0.5, 1.0, 0.5), "constant", hold=3.0)
    explanation = explain(problem, evaluate(problem, Candidate({"u": signal})))
    assert [e.span for e in explanation.effects[1:]] == [(0.0, 3.0), (3.0, 6.0), (6.0, 10.0)]
    # A curve has the value that it is reset to at its control points only.
    curve = Signal((0.0, 2.0, 5.0, 7.0, 10.0), (-1.0, 1.0, 1.0, 0.5, 1.0), "pchip")
    problem = lag_problem("G[9,10] (x <= 0.8)", free=FREE)
    explanation = explain(problem, evaluate(problem, Candidate({"u": curve})))
    assert [e.span for e in explanation.effects[1:]] == [(0.0, 0.0), (2.0, 5.0), (7.0, 7.0), (10.0, 10.0)]
    assert "With u at rest (0 V) at 10 s alone: +0.4821" in explanation.text


def test_what_is_at_rest_is_put_to_the_middle_of_its_range() -> None:
    shifted = ParameterRange("x0", 0.0, 1.0, nominal=0.0)
    problem = lag_problem("G[0,10] (x >= 0.1)", parameters=(shifted,))
    explanation = explain(problem, evaluate(problem, problem.space.decode([0.0] * 4 + [0.0])))
    x0 = next(e for e in explanation.effects if e.name == "x0")
    assert (x0.instead, x0.is_rest) == (0.5, False)
    assert "With x0 at the middle of its range (0.5) alone: -0.09999, still violated." in explanation.text
    for high, told in ((5.0, "near the middle (3)"), (4.0, "at the middle (2)"), (1.0, "at an end (1)")):
        whole = lag_problem(parameters=(ParameterRange("x0", 0.0, high, kind="integer", nominal=0.0),))
        found = explain(whole, evaluate(whole, whole.space.decode([1.0] * 4 + [0.0])))
        assert f"With x0 {told.replace(' (', ' of its range (')} alone" in found.text
    mode = ParameterRange("x0", 0, 2, kind="enumeration", items=(("off", 0), ("on", 2)), nominal=0.0)
    named = lag_problem(parameters=(mode,))
    found = explain(named, evaluate(named, named.space.decode([1.0] * 4 + [0.0])))
    assert "With x0 at an end of its range (2 = on) alone" in found.text


def test_what_resetting_would_not_change_is_left_out() -> None:
    problem = lag_problem(parameters=(X0,))  # the nominal value of x0 is the middle of its range
    explanation = explain(problem, evaluate(problem, problem.space.decode([1.0] * 4 + [0.0])))
    assert [e.name for e in explanation.effects] == ["u"]
    assert "x0" not in explanation.text


def test_a_part_without_which_the_simulation_fails_is_said_and_a_failed_one_not_explained() -> None:
    def fails_at_rest(times: Array, inputs: Columns, parameters: dict[str, float]) -> Mapping[str, Array]:
        return broken(times, {"u": 1 - inputs["u"]}, parameters)

    problem = lag_problem("G[0,10] (x >= 0.5)", response=fails_at_rest)
    explanation = explain(problem, evaluate(problem, problem.space.decode([1.0] * 4)))
    assert "With u at rest (0 V) alone, the simulation fails." in explanation.text
    problem = lag_problem(response=broken)
    with pytest.raises(SpecError, match="no trajectory to explain"):
        explain(problem, evaluate(problem, problem.space.decode([1.0] * 4)))


def test_of_a_near_miss_is_said_what_brings_it_near_and_what_keeps_it_away() -> None:
    problem = lag_problem("G[0,10] (x <= 2)", inputs=2)
    found = explain(problem, evaluate(problem, problem.space.decode([1.0] * 4 + [-0.5] * 4)))
    assert not found.violated
    assert "It is not violated here: the robustness, the margin by which it holds, is +" in found.text
    assert "With u at rest (0 V) alone: +2, farther from a violation." in found.text
    assert "With v at rest (0 V) alone: +1, nearer to one." in found.text
    assert "counterexample" not in found.text


def test_a_violation_that_explaining_meets_is_told() -> None:
    bias = ParameterRange("bias", -1.0, 1.0, nominal=-1.0)
    problem = lag_problem("G[0,10] (x >= -0.5)", parameters=[bias])
    told = explain(problem, evaluate(problem, problem.space.decode([0.0, 0.0, 0.0, 0.0, 0.5]))).text
    assert "With bias at its nominal value (-1) alone: -0.5, violated, which is not confirmed yet." in told
