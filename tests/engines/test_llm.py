"""The language model as an engine, on scripted chats and against a server on this machine."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.engines.llm import LLMEngine, random_change
from falsifier.engines.protocol import Engine
from falsifier.errors import ChatError
from falsifier.evaluation.evaluate import evaluate
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.conversation import NoValidReplyError
from falsifier.llm.messages import Chat, Exchange
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.problem import Problem
from falsifier.record.journal import holds_run, read_journal
from falsifier.record.records import ExchangeRecord
from falsifier.record.run import falsify, resume
from falsifier.search.result import Result
from falsifier.testing import START, EngineContract, lag_problem
from tests.engines.support import doubtful
from tests.llm.server import Step, serving
from tests.problems import decades


def reply(values: Sequence[float], rationale: str = "because") -> str:
    return json.dumps({"rationale": rationale, "signals": [{"name": "u", "values": list(values)}]})


@pytest.mark.parametrize("anonymous", [False, True])
def test_what_a_reply_leaves_out_is_as_in_the_sample_that_it_names(*, anonymous: bool) -> None:
    problem = lag_problem(inputs=3, points=1, parameters=[START])
    names = ["u1", "u2", "u3", "p1"] if anonymous else list(problem.space.names)
    signals = [{"name": name, "values": [0.1 * k]} for k, name in enumerate(names[:3], start=1)]
    first = {"as_in": 0, "signals": signals, "parameters": [{"name": names[3], "value": 0.4}]}
    second = {"as_in": 1, "signals": [{"name": names[1], "values": [1.0]}]}
    engine = LLMEngine(problem, ScriptedChat(map(json.dumps, (first, second))), anonymous=anonymous)
    engine.tell([evaluate(problem, *engine.ask())])
    (candidate,) = engine.ask()
    assert [s.values[0] for s in candidate.signals.values()] == pytest.approx([0.1, 1.0, 0.3])
    assert list(candidate.parameters.values()) == [0.4]


def test_the_road_to_a_valid_reply(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rate limit, lost connection, bad JSON, a point out of range, a repetition, then success."""
    monkeypatch.setattr("falsifier.llm.client._FIRST_DELAY", 0.01)
    problem = lag_problem()
    script = (
        Step(reply([0.5, 0.5, 0.5, 0.5])),
        Step(status=429, headers={"Retry-After": "0.05"}),
        Step(hang_up=True),
        Step('{"signals": [{"name": "u", "values": [1, 1'),
        Step(reply([0, 0, 0, 7])),
        Step(reply([0.5, 0.5, 0.5, 0.5])),
        Step(reply([1, 1, 1, 1])),
    )
    exchanges: list[Exchange] = []
    with serving(*script) as server:
        chat = LiteLLMChat("openai/m", api_base=server.url)
        engine = LLMEngine(problem, chat, variant="MP4")
        engine.attach(exchanges.append, lambda inner: inner)
        engine.tell([evaluate(problem, *engine.ask())])
        (instead,) = engine.ask()
        assert (instead.origin, instead.rationale) == (
            "random change",
            "a random change of the best sample, because openai/m gave no valid reply",
        )
        engine.tell([evaluate(problem, instead)])
        assert evaluate(problem, *engine.ask()).violated
        assert len(server.received) == 7
    problems = [e.problem for e in exchanges]
    assert problems[0] is None and problems[-1] is None
    assert "no JSON object" in (problems[1] or "")
    assert "'u' at t = 10 s: 7 is outside its range [-1, 1]" in (problems[2] or "")
    assert problems[3] == "it repeats an earlier sample"
    assert exchanges[1].reply is not None and exchanges[1].reply.attempts == 3


def test_a_random_change_is_small_repeatable_and_within_the_ranges() -> None:
    space = lag_problem(parameters=[START]).space
    best = space.decode([1.0, -1.0, 0.0, 0.5, 0.25])
    changes = []
    for seed in range(30):
        found = random_change(space, best, seed=(seed,))
        assert found == random_change(space, best, seed=(seed,))
        assert np.all(np.abs(space.encode(found)) <= 1)
        changes.append((space.encode(found) != space.encode(best)).sum())
    assert min(changes) == 1 and max(changes) < 5
    assert len({random_change(space, None, seed=(seed,)).key for seed in range(5)}) == 5


def test_a_random_change_of_a_range_in_decades_is_one_of_its_decades() -> None:
    space = decades().space
    chosen = [random_change(space, None, seed=(1, k)).parameters["bias"] for k in range(300)]
    assert 110 < sum(value < 10**-3.5 for value in chosen) < 190
    old = Candidate({}, {"bias": 2e-5})
    ratios = [random_change(space, old, seed=(2, k)).parameters["bias"] / 2e-5 for k in range(100)]
    assert 10 < sum(ratio < 0.1 for ratio in ratios) < 50 and 10 < sum(ratio > 10 for ratio in ratios) < 50


def test_an_llm_that_never_answers_validly_is_given_up() -> None:
    engine = LLMEngine(lag_problem(), ScriptedChat(lambda _: "nothing"))
    changed = [*engine.ask(), *engine.ask()]
    assert len({c.key for c in changed}) == 2
    assert changed[0].rationale.startswith("a random sample")
    with pytest.raises(NoValidReplyError, match="no valid reply in 3 attempts"):
        engine.ask()


def test_a_violation_that_does_not_count_is_told_with_the_reason() -> None:
    problem = lag_problem()
    chat = ScriptedChat([reply(v) for v in ([1, 1, 1, 1], [0, 1, 1, 1])])
    engine = LLMEngine(problem, chat)
    engine.begin(20)
    (found,) = engine.ask()
    evaluation = evaluate(problem, found)
    assert evaluation.violated
    engine.doubt(replace(doubtful(problem, evaluation), robustness=evaluation.robustness, halved=0.5))
    engine.tell([evaluation])
    engine.ask()
    asked = chat.requests[-1].messages[1].content
    assert "does not count as a violation, it is fragile" in asked
    assert "1 of 20 simulations spent, 19 left" in asked


def test_several_candidates_at_a_time() -> None:
    problem = lag_problem()
    both = json.dumps(
        {
            "candidates": [
                {"rationale": "a", "signals": [{"name": "u", "values": [v] * 4}]} for v in (0.1, 0.1, 0.2)
            ]
        }
    )
    chat = ScriptedChat([both, reply([0.3] * 4)])
    engine = LLMEngine(problem, chat, variant="MP4")
    candidates = engine.ask(3)
    assert [c.signals["u"].values[0] for c in candidates] == [0.1, 0.2, 0.3]
    assert "Proposed and not simulated" in chat.requests[1].messages[-1].content
    engine.tell([evaluate(problem, c) for c in candidates])
    assert "Proposed and not simulated" not in preview_of(chat, engine)


def preview_of(chat: ScriptedChat, engine: Engine) -> str:
    with pytest.raises(ChatError):
        engine.ask()
    return chat.requests[-1].messages[1].content


class Killed(BaseException):
    """The process dies."""


@pytest.mark.parametrize("last", range(1, 8))
def test_killed_and_resumed_without_asking_twice(tmp_path: Path, last: int) -> None:
    """Whenever the run dies, the two halves together send what one whole run sends."""
    script = [
        reply([0.1] * 4),
        "no JSON at all",
        reply([0.2] * 4),
        reply([0.2] * 4),
        reply([0.3, 0.3, 0.3, 9]),
        reply([0.3] * 4),
        reply([0.4] * 4),
        reply([1.0] * 4),
    ]
    whole = ScriptedChat(list(script))
    expected = recorded_run(lag_problem(), whole, tmp_path / "whole")

    def dying() -> Iterator[str]:
        yield from script[:last]
        raise Killed

    first = ScriptedChat(dying())
    with pytest.raises(Killed):
        recorded_run(lag_problem(), first, tmp_path / "halves")
    second = ScriptedChat(script[last:])
    result = recorded_run(lag_problem(), second, tmp_path / "halves")
    assert [e.candidate.key for e in result.evaluations] == [e.candidate.key for e in expected.evaluations]
    assert result.status == expected.status == "falsified"
    assert [*first.requests[:last], *second.requests] == whole.requests
    assert result.spent.calls == expected.spent.calls == len(script)
    records = read_journal(tmp_path / "halves")
    assert sum(isinstance(r, ExchangeRecord) for r in records) == len(script)


def recorded_run(problem: Problem, chat: Chat, directory: Path) -> Result:
    """Run, or resume where the directory holds a run already."""
    engine = LLMEngine(problem, chat, variant="MP5")
    if holds_run(directory):
        return resume(directory, problems=[problem], engine=engine)[0]
    return falsify(problem, engine, budget=20, directory=directory)


class TestContract(EngineContract):
    """It keeps what every engine keeps, with a scripted model that never repeats itself."""

    def make(self, problem: Problem, seed: int) -> Engine:
        def points() -> Iterator[str]:
            rng = np.random.default_rng(seed)
            while True:
                point = rng.uniform(-1.0, 1.0, len(problem.space.dimensions))
                yield json.dumps({"rationale": "the next one", "point": point.tolist()})

        return LLMEngine(problem, ScriptedChat(points()))


def test_lessons_and_the_reason_are_told_back() -> None:
    problem = lag_problem()

    def answer(level: float, lessons: str) -> str:
        signal = {"name": "u", "values": [level] * 4}
        return json.dumps({"lessons": lessons, "rationale": f"try {level}", "signals": [signal]})

    chat = ScriptedChat([answer(0.1, "x follows u"), answer(0.2, ""), answer(0.3, "")])
    engine = LLMEngine(problem, chat)
    for _ in range(3):
        engine.tell([evaluate(problem, *engine.ask())])
    first, second, third = (r.messages[1].content for r in chat.requests)
    assert "lessons" not in first
    for later in (second, third):  # an empty field takes nothing back
        assert "Your lessons so far: x follows u" in later
        assert "chosen because: try 0.1" in later
    assert third.startswith(second[: chat.requests[1].messages[1].stable])
