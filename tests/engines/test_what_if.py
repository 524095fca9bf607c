"""The hybrid engine's model calls the surrogate for predictions in its turn."""

import json
import re
import shutil
from functools import partial
from pathlib import Path

import pytest

from falsifier.engines.hybrid import Hybrid
from falsifier.engines.llm import LLMEngine
from falsifier.engines.protocol import Engine
from falsifier.errors import ChatError
from falsifier.evaluation.evaluate import evaluate
from falsifier.llm.messages import Chat, ChatReply, ChatRequest, Exchange, ToolCall, Usage
from falsifier.llm.replay import ScriptedChat
from falsifier.record.journal import holds_run, read_journal
from falsifier.record.records import ExchangeRecord
from falsifier.record.run import falsify, resume
from falsifier.search.budget import Budget
from falsifier.search.result import Result
from falsifier.testing import drive
from tests.engines.support import wide_problem
from tests.engines.test_hybrid import SETTINGS

Line = str | ChatReply | Exception


def exchanges_in(directory: Path) -> list[Exchange]:
    """What a run has recorded of its language model."""
    return [r.exchange for r in read_journal(directory) if isinstance(r, ExchangeRecord)]


def candidates(*levels: float, name: str = "u", told: str = "a guess") -> str:
    def one(level: float) -> dict[str, object]:
        signal = {"name": name, "interpolation": "constant", "times": [0], "values": [level]}
        return {"rationale": told, "signals": [signal]}

    return json.dumps({"candidates": [one(level) for level in levels]})


def call(*levels: float, name: str = "u") -> ChatReply:
    made = ToolCall(id="c", name="predict", arguments=candidates(*levels, name=name))
    return ChatReply(
        text="", tool_calls=(made,), usage=Usage(prompt_tokens=7, completion_tokens=3, cost=0.25)
    )


def hybrid(chat: Chat, *, anonymous: bool = False) -> Hybrid:
    adviser = LLMEngine(wide_problem(), chat, anonymous=anonymous)
    return Hybrid(wide_problem(), seed=0, adviser=adviser, promising=-9.0, surrogate_settings=SETTINGS)


def run(engine: Engine, rounds: int = 14) -> list[str]:
    """Rationales of the candidates in order."""
    judge = partial(evaluate, wide_problem())
    return [c.rationale for c in drive(engine, judge, rounds=rounds)]


def answers(request: ChatRequest) -> list[str]:
    return [m.content for m in request.messages if m.role == "tool"]


def first_offer(requests: list[ChatRequest]) -> int:
    return next(i for i, request in enumerate(requests) if request.tools)


def test_it_calls_twice_and_then_answers() -> None:
    # Until forecasts have proved good, no tool is offered; from then on every question offers it.
    def script(request: ChatRequest) -> Line:
        if not request.tools:
            return candidates(-1.0, 0.5) if len(chat.requests) == 1 else candidates(0.1 * len(chat.requests))
        told = answers(request)
        return call(0.5, 1.5) if not told else call(1.75) if len(told) == 1 else candidates(1.75, told="best")

    chat = ScriptedChat(script)
    rationales = run(hybrid(chat))
    at = first_offer(chat.requests)
    first, second, third = (answers(r) for r in chat.requests[at : at + 3])
    assert first == [] and len(second) == 1 and len(third) == 2
    robustness = [float(v) for v in re.findall(r"predicted robustness \+([\d.]+)", "\n".join(third))]
    # 9 minus what x reaches in ten seconds from 0.
    assert robustness == pytest.approx([8.5, 7.5, 7.25], abs=0.3)
    assert "by x <= 9" in third[0]
    assert "2 more calls can be answered" in third[0] and "1 more call can be answered" in third[1]
    assert any(re.fullmatch(r"best \[predicted robustness 7\.\d+\]", r) for r in rationales)


def test_neutral_names_hold_in_calls_and_answers() -> None:
    def script(request: ChatRequest) -> Line:
        if not request.tools:
            levels = (25.0, 62.5) if len(chat.requests) == 1 else (50.0 + 2 * len(chat.requests),)
            return candidates(*levels, name="u1")
        told = answers(request)
        return call(87.5, name="u1") if not told else candidates(93.75, name="u1")

    chat = ScriptedChat(script)
    engine = hybrid(chat, anonymous=True)
    judge = partial(evaluate, wide_problem())
    asked = drive(engine, judge, rounds=14)
    sent = [r for r in chat.requests if r.tools]
    assert "by y1 <= 73.0769231" in answers(sent[1])[0]
    everything = "\n".join(m.content for r in sent for m in r.messages) + str([r.tools for r in sent])
    # An x between numbers counts repeated values.
    assert not re.search(r"\bu\b|(?<!\d )\bx\b|\blag\b|drive|position", everything)
    assert any(set(c.signals["u"].values) == {1.75} for c in asked)


class TestResume:
    """A run that was killed in the middle of a turn goes on with the same candidate."""

    def script(self, request: ChatRequest) -> Line:
        opening = "Propose the first" in request.messages[-1].content
        if opening:
            return candidates(-1.0, 0.5)
        samples = len(set(re.findall(r"Sample (\d+)", request.messages[1].content)))
        if not request.tools:
            return candidates(0.01 * samples)
        told = answers(request)
        return call(1.0 + 0.01 * len(told)) if len(told) < 2 else candidates(1.5 + 0.01 * samples)

    def search(self, directory: Path, chat: Chat, simulations: int, tokens: int | None = None) -> Result:
        """Run, or continue where the directory holds a run already."""
        engine, budget = hybrid(chat), Budget(simulations=simulations, tokens=tokens)
        if holds_run(directory):
            return resume(directory, problems=[wide_problem()], engine=engine, budget=budget)[0]
        return falsify(wide_problem(), engine, budget=budget, directory=directory)

    def test_mid_turn(self, tmp_path: Path) -> None:
        whole = self.search(tmp_path / "whole", ScriptedChat(self.script), 14)
        assert whole.spent.cost == pytest.approx(0.25 * len(self.calls(tmp_path / "whole")))
        lines = (tmp_path / "whole" / "journal.jsonl").read_bytes().splitlines(keepends=True)
        cuts = [i for i, line in enumerate(lines) if b'"tool_calls":[{' in line][:2]
        for number, cut in enumerate(cuts, start=1):
            directory = tmp_path / f"cut{number}"
            shutil.copytree(tmp_path / "whole", directory)
            (directory / "journal.jsonl").write_bytes(b"".join(lines[: cut + 1]))
            rest = ScriptedChat(self.script)
            recorded = exchanges_in(directory)
            resumed = self.search(directory, rest, 14)
            assert [e.candidate.key for e in resumed.evaluations] == [
                e.candidate.key for e in whole.evaluations
            ]
            assert resumed.spent.calls == whole.spent.calls
            assert len(answers(rest.requests[0])) == number
            assert len(rest.requests) + len(recorded) == whole.spent.calls

    def test_a_turn_ends_where_the_budget_does(self, tmp_path: Path) -> None:
        chat = ScriptedChat(self.script)
        cut = self.search(tmp_path / "run", chat, 16, tokens=5)
        assert cut.status == "not falsified" and "5 tokens is used up" in cut.reason
        assert chat.requests[-1].tools and answers(chat.requests[-1]) == [], "the call was not answered"
        assert cut.spent.tokens == 10
        # With more to spend the run goes on, from the same candidates.
        resumed = self.search(tmp_path / "run", ScriptedChat(self.script), 16)
        assert len(resumed.evaluations) == 16 > len(cut.evaluations)
        for before, after in zip(cut.evaluations, resumed.evaluations, strict=False):
            assert before.candidate.key == after.candidate.key

    def test_a_turn_that_failed_fails_again(self, tmp_path: Path) -> None:
        """No answer in the second half of a turn: the surrogate goes on, and so it does when resumed."""

        def breaking(request: ChatRequest) -> Line:
            if len(answers(request)) == 1 and not chat_failed:
                chat_failed.append(True)
                return ChatError("the server is gone")
            return self.script(request)

        chat_failed: list[bool] = []
        whole = self.search(tmp_path / "run", ScriptedChat(breaking), 16)
        assert chat_failed
        nobody = ScriptedChat([ChatError("nobody is asked")])
        resumed = self.search(tmp_path / "run", nobody, 16)
        assert [e.candidate.key for e in resumed.evaluations] == [e.candidate.key for e in whole.evaluations]
        assert nobody.requests == []

    def calls(self, directory: Path) -> list[Exchange]:
        return [e for e in exchanges_in(directory) if e.reply and e.reply.tool_calls]
