"""Neutral names and scales out, real ones back."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace

import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import InputRange, SearchSpace
from falsifier.engines.briefing import preview
from falsifier.engines.llm import LLMEngine
from falsifier.evaluation.evaluate import Evaluation, evaluate, start_values
from falsifier.llm.messages import ChatRequest
from falsifier.llm.prompts import VARIANTS, View
from falsifier.llm.prompts.disguise import Disguise
from falsifier.llm.prompts.standing import standing
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.testing import FREE, START, lag_problem
from tests.engines.support import doubtful

WORDS = r"throttle|brake|speed|rpm|gear|mph|ft\.lbf|rev/min|Car|transmission|AT\d|Pos|Ref|magnet|integer"
# Ends of ranges, thresholds, and a factor of a threshold, each as a number of its own.
NUMBERS = {"AT6a": "325|3000|35", "AT51": "325", "NN": r"0\.005|0\.035|0\.03\*"}


def text_of(requests: Sequence[ChatRequest]) -> str:
    return "\n".join(message.content for request in requests for message in request.messages)


def asked(name: str, variant: str, replies: Sequence[str]) -> tuple[str, Problem, list[Evaluation]]:
    """What is sent in a run of two samples, the second after a rejected reply."""
    problem = load_problem(name)
    chat = ScriptedChat(list(replies))
    engine = LLMEngine(problem, chat, variant=variant, anonymous=True)
    done = []
    for _ in range(2):
        (candidate,) = engine.ask()
        done.append(evaluate(problem, candidate))
        engine.tell(done[-1:])
    assert len(chat.requests) == 3
    sent = text_of([*chat.requests, ChatRequest(messages=preview(
        problem, variant=variant, evaluations=done, anonymous=True))])  # fmt: skip
    return sent, problem, done


def bad_replies(problem: Problem) -> list[str]:
    """Replies that are rejected in every way in which names could be told."""
    size = len(problem.space.dimensions)
    return [
        json.dumps({"point": [7e5] * size}),
        json.dumps({"point": [0.5] * (size + 1)}),
        json.dumps({"point": [0.25] * size}),  # the first sample again
        json.dumps({"signals": [{"name": "throttl", "values": [1]}]}),
        json.dumps({"signals": [{"name": "u1", "values": [1]}, {"name": "u1", "values": [1]}]}),
        json.dumps({"signals": [], "parameters": []}),
        "no JSON",
    ]


@pytest.mark.parametrize(("variant", "anonymous"), [("MP1", False), *((v, True) for v in VARIANTS)])
@pytest.mark.parametrize("name", ["AT6a", "PulseMeter"])
def test_no_name_is_told_that_the_variant_hides(name: str, variant: str, *, anonymous: bool) -> None:
    problem = load_problem(name)
    first = json.dumps({"point": [0.25] * len(problem.space.dimensions)})
    if name == "PulseMeter":
        first = json.dumps({"point": [0, 1] * (len(problem.space.dimensions) // 2)})
    sent = []
    for bad in bad_replies(problem):
        chat = ScriptedChat([first, bad, bad, bad])
        engine = LLMEngine(problem, chat, variant=variant, anonymous=anonymous)
        engine.tell([evaluate(problem, *engine.ask())])
        engine.ask()
        sent += chat.requests
    problem.model.close()
    told = "\n".join(m.content for r in sent for m in r.messages if m.role != "assistant")
    assert "That reply cannot be used" in told
    names = {n for n in (*problem.space.names, *problem.experiment.outputs)}
    for name in names:
        assert not re.search(rf"(?<![\w.]){re.escape(name)}(?![\w.])", told), name


@pytest.mark.parametrize(
    ("name", "variant"), [("AT6a", "MP1"), ("AT51", "MP5"), ("NN", "MP4"), ("AT6a", "MP5")]
)
def test_nothing_real_is_told(name: str, variant: str) -> None:
    size = len(load_problem(name).space.dimensions)
    replies = [f'{{"point": {json.dumps([value] * size)}}}' for value in (25, 700, 50)]
    sent, problem, done = asked(name, variant, replies)
    assert not re.search(WORDS, sent.replace("Car ", ""))
    assert not re.search(rf"(?<![\d.])(?:{NUMBERS[name]})(?![\d.]|: | s\b)", numbers_of_interest(sent))
    assert "700 are outside its range [0, 100]" in sent or "700, 700" in sent
    first, second = (problem.space.encode(e.candidate) for e in done)
    low, high = problem.space.bounds.T
    assert first == pytest.approx(low + 0.25 * (high - low), rel=1e-12)
    assert second == pytest.approx((low + high) / 2, rel=1e-12)


def numbers_of_interest(sent: str) -> str:
    """The text without what is in seconds, and without counts."""
    return re.sub(r"\[\d+,\d+\]|\d+ (?:to \d+ s|numbers|simulations|evenly)|at most \d+|percent", "", sent)


def disguised(problem: Problem) -> Disguise:
    return Disguise.of(View.of(problem))


def test_candidates_come_back_under_their_names_and_in_their_ranges() -> None:
    problem = load_problem("AT1")
    signals = {
        "u1": Signal.evenly([100.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.1], stop_time=50.0, hold=0.05),
        "u2": Signal.evenly([30.0] * 3, stop_time=50.0, hold=0.05),
    }
    disguise = disguised(problem)
    back = disguise.revealed(Candidate(signals, {}, "m", "more u1 raises y1, u9 is no name"))
    assert back.signals["throttle"].values == (100.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.1)
    assert back.signals["brake"].values == pytest.approx((97.5,) * 3, rel=1e-15)
    assert back.rationale == "more throttle raises speed, u9 is no name"
    assert disguise.hidden_candidate(problem.space.admit(back)).signals == signals


def test_robustness_is_that_of_the_scaled_formula() -> None:
    problem = load_problem("AT1")
    disguise = disguised(problem)
    real = evaluate(problem, problem.space.decode([100] * 7 + [0] * 3))
    hidden = disguise.fitted([real]).hidden(real)
    assert real.verdict is not None and hidden.verdict is not None
    # The FMU declares -10 to 250 mph, which becomes 20 to 80.
    assert hidden.verdict.predicate == "y1 <= 50"
    assert hidden.verdict.robustness == pytest.approx(real.verdict.robustness * 60 / 260, rel=1e-6)
    assert hidden.verdict.critical_time == real.verdict.critical_time
    bare = disguise.hidden(replace(real, trajectory=None))
    assert bare.trajectory is None and bare.verdict is not None
    assert bare.verdict.robustness == pytest.approx(hidden.verdict.robustness, rel=1e-6)
    assert bare.verdict.values["y1"] == pytest.approx(50 - hidden.verdict.robustness, rel=1e-9)
    assert round(bare.verdict.values["y3"], 9) in (20, 40, 60, 80)


@pytest.mark.parametrize(
    ("formula", "hidden"),
    [
        ("G[0,10] (x <= 0.9)", "G[0,10] (y1 <= 50)"),
        ("G[0,10] (u <= 0.5)", "G[0,10] (u1 <= 75)"),
        ("G[0,10] (x <= 0.9 and -0.35 <= x)", "G[0,10] (y1 <= 73.0769231 and 26.9230769 <= y1)"),
        ("G[0,10] (abs(x) >= 0.1)", "G[0,10] (z1 >= 50)"),
        ("G[0,10] (x > 0)", "G[0,10] (y1 > 50)"),
        ("G[0,10] (3*x - u != 0)", "G[0,10] (z1 != 50)"),
        ("G[0,10] (x < 0 or x <= -0.35)", "G[0,10] (y1 < 73.0769231 or y1 <= 26.9230769)"),
        ("G[0,10] (x^2 <= 1 -> abs(x - u) < 3)", "G[0,10] (z1 <= 50 -> z2 < 50)"),
    ],
)
def test_what_becomes_of_a_formula(formula: str, hidden: str) -> None:
    problem = lag_problem(formula)
    disguise = disguised(problem)
    assert str(disguise.view.requirement.formula) == hidden
    for value in (-1.0, -0.3, 0.0, 0.95, 1.0):
        real = evaluate(problem, problem.space.decode([value] * 4))
        settled = disguise.fitted([real])
        assert str(settled.view.requirement.formula) == hidden
        told = settled.hidden(real)
        assert real.verdict is not None and told.verdict is not None
        assert (told.verdict.robustness < 0) == (real.verdict.robustness < 0)
        foretold = settled.hidden_verdict(real.verdict)
        assert foretold.breach is None, "it would tell real names"
        assert foretold.robustness == pytest.approx(told.verdict.robustness, abs=1e-6)


def test_scales_do_not_change() -> None:
    problem = load_problem("CCx")
    disguise = Disguise.of(View.of(problem), start_values(problem))
    told_first = disguise.view.info.description, str(disguise.view.requirement.formula)
    first, second = (
        evaluate(problem, problem.space.decode(p)) for p in ([1.0] * 10 + [0.0] * 10, [0.0] * 20)
    )
    fitted = disguise.fitted([first])
    assert fitted.fitted([second]) == fitted
    assert (fitted.view.info.description, str(fitted.view.requirement.formula)) == told_first
    for evaluation in (first, second):
        told = fitted.hidden(evaluation).trajectory
        assert told is not None
        assert {told[f"y{i}"][0] for i in range(1, 6)} == {50.0}
    gear = Disguise.of(View.of(load_problem("AT51"))).view
    assert (gear.kind("z1"), gear.description("z1")) == ("enumeration", "derived from y1")
    assert disguise.view.info["z2"].description == "derived from y3 and y1"


@pytest.mark.parametrize(
    ("high", "told", "answered", "real"),
    [
        (4.0, "; integers from 0 to 3; ", [1, 3, 0, 2], (2, 4, 1, 3)),
        (201.0, "; from 0 to 100; ", [0.5, 100, 0, 50], (2, 201, 1, 101)),
    ],
)
def test_integers_of_few_values_keep_their_steps(
    high: float, told: str, answered: list[float], real: tuple[int, ...]
) -> None:
    problem = lag_problem(limit=5.0)
    count = InputRange("u", 1.0, high, control_points=4, interpolation="constant", kind="integer", free=FREE)
    problem = replace(problem, space=SearchSpace((count,), (), 10.0))
    disguise = disguised(problem)
    assert told in standing(disguise.view, VARIANTS["MP5"])
    answer = Candidate({"u1": Signal.evenly(answered, stop_time=10.0, interpolation="linear")})
    back = problem.space.admit(disguise.revealed(answer))
    assert (back.signals["u"].values, back.signals["u"].interpolation) == (real, "constant")


def test_doubts_and_start_values_are_scaled() -> None:
    problem = lag_problem("G[0,10] (x <= 0.9)", parameters=[START])
    violation = evaluate(problem, problem.space.decode([1, 1, 1, 1, 0]))
    chat = ScriptedChat([f'{{"point": [50, 50, 50, 50, {n}]}}' for n in (50, 60)])
    engine = LLMEngine(problem, chat, anonymous=True)
    engine.ask()
    engine.doubt(replace(doubtful(problem, violation), outcome="refuted", robustness=0.585, reference=None))
    engine.tell([violation])
    engine.ask()
    sent = text_of(chat.requests)
    assert "a second simulation gave robustness +13.5. " in sent
    assert "y1: " in sent.replace("- y1;", "y1: ") and "p1" in sent
