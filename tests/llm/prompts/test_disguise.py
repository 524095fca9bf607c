"""Neutral names out, real ones back."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.model import Variable
from falsifier.core.ranges import InputRange
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace
from falsifier.engines.briefing import preview
from falsifier.engines.llm import LLMEngine
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.messages import ChatRequest
from falsifier.llm.prompts import VARIANTS, Questions, View
from falsifier.llm.prompts.disguise import Disguise
from falsifier.llm.prompts.standing import standing
from falsifier.llm.replies import ReplyForm
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.loading import load_problem
from falsifier.testing import FREE, START, lag_problem
from tests.engines.support import doubtful

WORDS = r"throttle|brake|speed|rpm|gear|mph|ft\.lbf|rev/min|Car|transmission|AT\d|Pos|Ref|magnet|\binteger\b"


def bad_replies(first: list[float]) -> list[str]:
    """Replies that are rejected in every way in which names could be told."""
    return [
        json.dumps({"point": [7e5] * len(first)}),
        json.dumps({"point": [*first, 0.5]}),
        json.dumps({"point": [0.25] * len(first)}),
        json.dumps({"point": first}),  # again
        json.dumps({"signals": [{"name": "throttl", "values": [1]}]}),
        json.dumps({"signals": [{"name": "u1", "values": [1]}, {"name": "u1", "values": [1]}]}),
        json.dumps({"signals": [], "parameters": []}),
        "no JSON",
    ]


@pytest.mark.parametrize(("variant", "anonymous"), [("MP1", False), *((v, True) for v in VARIANTS)])
@pytest.mark.parametrize("name", ["AT6a", "NN", "PulseMeter"])
def test_no_name_is_told_that_the_variant_hides(name: str, variant: str, *, anonymous: bool) -> None:
    problem = load_problem(name)
    low, high = problem.space.bounds.T
    is_boolean = name == "PulseMeter"
    first = np.resize([0.0, 1.0], len(low)) if is_boolean else low + 0.25 * (high - low)
    requests, done = list[ChatRequest](), list[Evaluation]()
    for bad in bad_replies(first.tolist()):
        chat = ScriptedChat([json.dumps({"point": first.tolist()}), bad, bad, bad])
        engine = LLMEngine(problem, chat, variant=variant, anonymous=anonymous)
        done = [evaluate(problem, *engine.ask())]
        engine.tell(done)
        engine.ask()
        requests += chat.requests
    problem.model.close()
    assert problem.space.encode(done[0].candidate) == pytest.approx(first, rel=1e-6)
    again = preview(problem, variant=variant, evaluations=done, anonymous=anonymous)
    sent = [message for request in requests for message in request.messages] + list(again)
    told = "\n".join(message.content for message in sent if message.role != "assistant")
    assert "That reply cannot be used" in told
    for name in (*problem.space.names, *problem.experiment.outputs):
        assert not re.search(rf"(?<![\w.]){re.escape(name)}(?![\w.])", told), name
    assert not (anonymous and re.search(WORDS, told))


def test_candidates_come_back_under_their_names() -> None:
    problem = load_problem("AT1")
    signals = {
        "u1": Signal.evenly([100.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.1], stop_time=50.0, hold=0.05),
        "u2": Signal.evenly([30.0] * 3, stop_time=50.0, hold=0.05),
    }
    disguise = Disguise.of(View.of(problem))
    back = disguise.revealed(Candidate(signals, {}, "m", "more u1 raises y1, u9 is no name"))
    assert back.signals == {"throttle": signals["u1"], "brake": signals["u2"]}
    assert back.rationale == "more throttle raises speed, u9 is no name"
    assert disguise.hidden_candidate(problem.space.admit(back)).signals == signals


def test_what_was_simulated_is_told_under_neutral_names() -> None:
    problem = load_problem("AT1")
    disguise = Disguise.of(View.of(problem))
    real = evaluate(problem, problem.space.decode([100] * 7 + [0] * 3))
    assert real.verdict is not None and real.trajectory is not None
    told = disguise.hidden(real)
    assert told.verdict is not None and told.trajectory is not None
    assert (told.verdict.robustness, told.verdict.predicate) == (real.verdict.robustness, "y1 <= 120")
    assert (told.trajectory["y1"] == real.trajectory["speed"]).all()
    bare = disguise.hidden(replace(real, trajectory=None)).verdict
    assert bare is not None and bare.breach is None, "it would tell real names"
    assert (bare.predicate, bare.critical_time) == ("y1 <= 120", real.verdict.critical_time)
    assert bare.values["y1"] == real.verdict.values["speed"]


@pytest.mark.parametrize(
    ("formula", "hidden"),
    [
        ("G[0,10] (x <= 0.9 and -0.35 <= x)", "G[0,10] (y1 <= 0.9 and -0.35 <= y1)"),
        ("G[0,10] (x^2 <= 1 -> abs(x - u) < 3)", "G[0,10] (y1^2 <= 1 -> abs(y1 - u1) < 3)"),
    ],
)
def test_what_becomes_of_a_formula(formula: str, hidden: str) -> None:
    assert str(Disguise.of(View.of(lag_problem(formula))).view.requirement.formula) == hidden


def test_something_discrete_is_told_as_whole_numbers() -> None:
    problem = lag_problem(limit=5.0)
    count = InputRange("u", 1.0, 4.0, control_points=4, interpolation="constant", kind="integer", free=FREE)
    disguise = Disguise.of(View.of(replace(problem, space=SearchSpace((count,), (), 10.0))))
    assert "; integers from 1 to 4; " in standing(disguise.view, VARIANTS["MP5"])


def test_a_doubt_is_told() -> None:
    problem = lag_problem("G[0,10] (x <= 0.9)", parameters=[START])
    violation = evaluate(problem, problem.space.decode([1, 1, 1, 1, 0]))
    chat = ScriptedChat([f'{{"point": [0.5, 0.5, 0.5, 0.5, {n}]}}' for n in (0.1, 0.2)])
    engine = LLMEngine(problem, chat, anonymous=True)
    engine.ask()
    engine.doubt(replace(doubtful(problem, violation), outcome="refuted", robustness=0.585, reference=None))
    engine.tell([violation])
    engine.ask()
    sent = "\n".join(message.content for request in chat.requests for message in request.messages)
    assert "a second simulation gave robustness +0.585. " in sent
    assert "y1: " in sent.replace("- y1;", "y1: ") and "p1" in sent


def test_numbers_of_an_enumeration_with_gaps_are_told_and_no_others_taken() -> None:
    problem = lag_problem(limit=5.0)
    mode = InputRange("u", 1, 7, kind="enumeration", items=(("Off", 1), ("Eco", 3), ("On", 7)),
                      interpolation="constant", control_points=2)  # fmt: skip
    view = Disguise.of(View.of(replace(problem, space=SearchSpace((mode,), (), 10.0)))).view
    assert "input signal u1; one of the numbers 1, 3, 7; " in standing(view, VARIANTS["MP5"])
    form = ReplyForm(view.space)
    (candidate,) = form.read(json.dumps({"signals": {"u1": [3, "7"]}}))
    assert candidate.signals["u1"].values == (3, 7)
    with pytest.raises(RejectedReplyError, match="2 is none of its numbers"):
        form.read(json.dumps({"signals": {"u1": [2, 7]}}))


def test_a_signal_that_starts_at_a_parameter_of_its_name_is_told_so() -> None:
    problem = lag_problem(parameters=[START])
    twice = replace(
        problem.info, variables=(*problem.info.variables, Variable(START.name, causality="output"))
    )
    view = Disguise.of(replace(View.of(problem), info=twice)).view
    assert "- start value p1; from -1 to 1" in standing(view, VARIANTS["MP5"])
    first = Questions(view, VARIANTS["MP5"]).ask()[1].content
    assert first.startswith("Good first samples are the limits of the ranges"), (
        "neutral names suggest nothing"
    )
