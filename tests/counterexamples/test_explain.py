from collections.abc import Mapping

import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import Freedom, ParameterRange
from falsifier.counterexamples.explain import explain, narrate
from falsifier.evaluation.evaluate import evaluate
from falsifier.llm.scripted import ScriptedChat
from falsifier.testing import Array, lag_problem
from tests.problems import broken

FREE = Freedom(10, 0.1)
X0 = ParameterRange("x0", -1.0, 1.0, nominal=0.0)


def test_a_signal_that_is_needed_is_named_with_what_happens_without_it() -> None:
    problem = lag_problem(parameters=(X0,))
    explanation = explain(problem, evaluate(problem, problem.space.decode([1.0] * 4 + [0.5])))
    effects = {e.name: e for e in explanation.effects if e.span is None}
    assert effects["u"].needed
    assert effects["u"].is_rest
    # At rest x falls from 0.5 to 0: the margin is smallest at the start.
    assert effects["u"].robustness == pytest.approx(0.4)
    assert not effects["x0"].needed
    assert "LAG requires: At all times from 0 to 10 s, x is at most 0.9." in explanation.text
    assert "u is necessary: at rest (0 V) robustness would be +0.4." in explanation.text
    text = "x0 is not necessary: at its nominal value (0) robustness would still be -0.09997."
    assert text in explanation.text
    assert explanation.diagnosis.critical_time == 10.0


def test_of_a_signal_the_stretches_that_count_are_named() -> None:
    problem = lag_problem("G[9,10] (x <= 0.9)", free=FREE)
    signal = Signal((0.0, 2.0, 5.0), (-1.0, 0.5, 1.0), "constant")
    explanation = explain(problem, evaluate(problem, Candidate({"u": signal})))
    spans = {e.span: e.needed for e in explanation.effects if e.span is not None}
    assert spans == {(0.0, 2.0): False, (2.0, 5.0): False, (5.0, 10.0): True}
    assert "u is decisive from 5 to 10 s: at rest (0 V) during that time" in explanation.text


def test_what_is_at_rest_is_put_to_the_middle_of_its_range() -> None:
    shifted = ParameterRange("x0", 0.0, 1.0, nominal=0.0)
    problem = lag_problem("G[0,10] (x >= 0.1)", parameters=(shifted,))
    explanation = explain(problem, evaluate(problem, problem.space.decode([0.0] * 4 + [0.0])))
    x0 = next(e for e in explanation.effects if e.name == "x0")
    assert (x0.instead, x0.is_rest, x0.was_rest) == (0.5, False, True)
    assert "x0 at its nominal value is not necessary: " in explanation.text
    assert "at the middle of its range (0.5) robustness would still be" in explanation.text


def test_a_part_without_which_the_simulation_fails_is_said() -> None:
    def fails_at_rest(
        times: Array, inputs: dict[str, Array], parameters: dict[str, float]
    ) -> Mapping[str, Array]:
        return broken(times, {"u": 1 - inputs["u"]}, parameters)

    problem = lag_problem("G[0,10] (x >= 0.5)", response=fails_at_rest)
    explanation = explain(problem, evaluate(problem, problem.space.decode([1.0] * 4)))
    assert "With u at rest (0 V) the simulation fails." in explanation.text


def test_a_failed_simulation_cannot_be_explained() -> None:
    problem = lag_problem(response=broken)
    with pytest.raises(ValueError, match="failed"):
        explain(problem, evaluate(problem, problem.space.decode([1.0] * 4)))


def test_a_language_model_is_given_the_findings_and_its_words_are_returned() -> None:
    problem = lag_problem()
    explanation = explain(problem, evaluate(problem, problem.space.decode([1.0] * 4)))
    chat = ScriptedChat(["", "The drive stays at its upper end.\n"])
    assert narrate(explanation, chat) == "The drive stays at its upper end."
    told = chat.requests[0].messages[-1].content
    for part in (
        "A first-order lag.",
        "- u [V]: drive",
        explanation.text,
        "u [V] constant 1",
        "\n10, 0.99997, 1\n",
    ):
        assert part in f"{told}\n"
    assert len(told.splitlines()) < 50


def test_of_a_near_miss_is_said_what_brings_it_near_and_what_keeps_it_away() -> None:
    problem = lag_problem("G[0,10] (x <= 2)", inputs=2)
    candidate = problem.space.decode([1.0] * 4 + [-0.5] * 4)
    found = explain(problem, evaluate(problem, candidate))
    assert not found.violated
    assert "It is not violated here; " in found.text
    assert "u brings it near: at rest (0 V) robustness would be +2." in found.text
    assert "v keeps it away: at rest (0 V) robustness would be +1, nearer." in found.text
    assert "counterexample" not in found.text


def test_a_violation_that_explaining_meets_is_told() -> None:
    bias = ParameterRange("bias", -1.0, 1.0, nominal=-1.0)
    problem = lag_problem("G[0,10] (x >= -0.5)", parameters=[bias])
    told = explain(problem, evaluate(problem, problem.space.decode([0.0, 0.0, 0.0, 0.0, 0.5]))).text
    assert "With bias at its nominal value (-1) the requirement would be violated by 0.5" in told
    assert "which is not confirmed yet" in told
