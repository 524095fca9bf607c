"""The language model as a proposer, on scripted chats and against a server on this machine."""

import json

from falsifier.evaluation import evaluate
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.messages import Exchange
from falsifier.llm.scripted import ScriptedChat
from falsifier.proposers.llm import make_llm_proposer, preview
from tests.llm.server import Step, serving
from tests.problems import lag_problem


def reply(values: list[float], rationale: str = "because") -> str:
    return json.dumps({"rationale": rationale, "signals": [{"name": "u", "values": values}]})


def test_two_samples_against_a_server() -> None:
    problem = lag_problem()
    with serving(Step(reply([0.5, 0.5, 0.5, 0.5])), Step(reply([1, 1, 1, 1], "full drive"))) as server:
        chat = LiteLLMChat("openai/gpt-5-mini", effort="low", api_base=server.url)
        exchanges: list[Exchange] = []
        proposer = make_llm_proposer(problem, chat, variant="MP4", on_exchange=exchanges.append)
        first = evaluate(problem, *proposer.ask())
        proposer.tell([first])
        second = evaluate(problem, *proposer.ask())
    assert first.robustness is not None and first.robustness > 0
    assert second.violated
    assert second.candidate.rationale == "full drive"
    assert second.candidate.origin == "openai/gpt-5-mini MP4"
    asked_first, asked_second = server.received
    assert asked_first.body["reasoning_effort"] == "low"
    assert asked_first.body["response_format"]["type"] == "json_schema"
    assert "Sample" not in asked_first.texts[-1]
    assert "+0.4" in asked_second.texts[-1]
    assert "0.5" in asked_second.texts[-1]
    assert exchanges[1].usage.reasoning_tokens == 12
    assert exchanges[1].usage.cost is None


def test_preview_is_what_is_sent() -> None:
    problem = lag_problem()
    chat = ScriptedChat([reply([0, 0, 0, 0])])
    make_llm_proposer(problem, chat, variant="MP2").ask()
    assert chat.requests[0].messages == preview(problem, variant="MP2")
