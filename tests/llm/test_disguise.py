"""Neutral names out, real names back."""

import re
from dataclasses import replace

import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.disguise import Disguise
from falsifier.llm.prompts import VARIANTS, View, build_prompt, render
from falsifier.problem.loading import load_problem
from falsifier.stl import parse
from falsifier.stl.renaming import renamed

REAL = r"throttle|brake|speed|rpm|gear|mph|ft\.lbf|rev/min|Car|transmission|AT1"


@pytest.mark.parametrize("variant", VARIANTS)
def test_nothing_real_is_told(variant: str) -> None:
    problem = load_problem("AT1")
    disguise = Disguise.of(View.of(problem))
    candidate = problem.space.decode([100] * 7 + [0, 0, 325])
    failed = Evaluation(candidate, "failed", reason="throttle: out of range", log=("speed is NaN",))
    evaluations = [disguise.hidden(e) for e in (evaluate(problem, candidate), failed)]
    text = "\n".join(m.content for m in render(build_prompt(disguise.view, VARIANTS[variant], evaluations)))
    assert not re.search(REAL, text)
    if variant != "MP1":
        assert "G[0,20] (y1 <= 120)" in text
        assert "u1" in text and "u2" in text


def test_candidates_come_back_under_their_names() -> None:
    problem = load_problem("AT1")
    disguise = Disguise.of(View.of(problem))
    signals = {
        "u1": Signal.evenly([1.0] * 7, stop_time=50.0, hold=0.05),
        "u2": Signal.evenly([2.0] * 3, stop_time=50.0, hold=0.05),
    }
    back = disguise.revealed(Candidate(signals, {}, "m", "more u1 raises y1, u9 is no name"))
    assert back.signals == {"throttle": signals["u1"], "brake": signals["u2"]}
    assert back.rationale == "more throttle raises speed, u9 is no name"
    assert disguise.hidden_candidate(problem.space.admit(back)).signals == signals


def test_verdicts_keep_their_numbers() -> None:
    problem = load_problem("AT1")
    disguise = Disguise.of(View.of(problem))
    real = evaluate(problem, problem.space.decode([100] * 7 + [0] * 3))
    hidden = disguise.hidden(real)
    assert real.verdict is not None and hidden.verdict is not None
    assert hidden.verdict.robustness == real.verdict.robustness
    assert hidden.verdict.predicate == "y1 <= 120"
    assert hidden.verdict.values["y1"] == real.verdict.values["speed"]
    assert disguise.hidden(replace(real, trajectory=None)).trajectory is None


def test_every_form_of_formula_is_renamed() -> None:
    formula = parse(
        "(G[0,1] (a > 0) -> F[0,2] (abs(b) + 2*a^2 <= max(a, -b))) "
        "and not (a < b) U[0,3] (X (b >= 1) or a == 2)"
    )
    swapped = renamed(formula, {"a": "first", "b": "second"})
    assert set(swapped.signals) == {"first", "second"}
    assert renamed(swapped, {"first": "a", "second": "b"}) == formula
