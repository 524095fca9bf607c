"""Tools: how they are offered, called, answered and refused."""

import json
from collections.abc import Sequence
from typing import Any

import pytest

from falsifier.core.candidate import Candidate
from falsifier.errors import ChatError
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.conversation import NoValidReplyError, RejectedReplyError, converse
from falsifier.llm.failures import ToolsUnsupportedError
from falsifier.llm.ladder import LadderChat
from falsifier.llm.litellm_import import may_take_tools
from falsifier.llm.messages import ChatReply, ChatRequest, Exchange, Message, Tool, ToolCall
from falsifier.llm.prompts import VARIANTS
from falsifier.llm.replies import ReplyForm
from falsifier.llm.scripted import ScriptedChat
from falsifier.llm.tools import MOST_CANDIDATES, PredictionTool, WhatIf
from falsifier.stl import Verdict
from tests.llm.server import Step, serving
from tests.problems import lag_problem

ADD = Tool(
    name="add",
    description="Adds.",
    parameters={
        "type": "object",
        "properties": {"terms": {"type": "array", "items": {"type": "number"}}},
        "required": ["terms"],
        "additionalProperties": False,
    },
)
SCHEMA = {
    "type": "object",
    "properties": {"sum": {"type": "number"}},
    "required": ["sum"],
    "additionalProperties": False,
}
QUESTION = ChatRequest(
    messages=(Message(role="user", content="what is 1 + 2?"),), reply_schema=SCHEMA, tools=(ADD,)
)
PLAIN = QUESTION.model_copy(update={"tools": ()})


def add(call: ToolCall) -> str:
    try:
        return str(sum(json.loads(call.arguments)["terms"]))
    except (ValueError, KeyError) as error:
        raise RejectedReplyError(f"no terms: {error!r}") from None


def calling(*terms: float, id: str = "c1") -> ChatReply:
    call = ToolCall(id=id, name="add", arguments=json.dumps({"terms": terms}))
    return ChatReply(text="", tool_calls=(call,), finish_reason="tool_calls")


def wrong(id: str = "w") -> ChatReply:
    return ChatReply(text="", tool_calls=(ToolCall(id=id, name="add", arguments="{}"),))


def asked(*script: str | ChatReply) -> tuple[str, ScriptedChat, list[Exchange]]:
    chat, exchanges = ScriptedChat(script), list[Exchange]()
    return converse(chat, QUESTION, str.strip, exchanges.append, respond=add), chat, exchanges


class TestConversation:
    def test_a_call_is_answered_and_the_question_goes_on(self) -> None:
        value, chat, exchanges = asked(calling(1, 2), "3")
        assert value == "3"
        following = chat.requests[1]
        assert following.tools == (ADD,)
        assert [m.role for m in following.messages] == ["user", "assistant", "tool"]
        assert following.messages[1].tool_calls[0].arguments == '{"terms": [1, 2]}'
        assert following.messages[2] == Message(role="tool", content="3", tool_call_id="c1")
        assert [e.problem for e in exchanges] == [None, None]

    def test_several_calls_at_once_are_answered_one_by_one(self) -> None:
        both = ChatReply(text="", tool_calls=calling(1, 2).tool_calls + calling(3, 4, id="c2").tool_calls)
        _, chat, _ = asked(both, "7")
        answers = [(m.tool_call_id, m.content) for m in chat.requests[1].messages if m.role == "tool"]
        assert answers == [("c1", "3"), ("c2", "7")]

    def test_a_wrong_call_is_told_what_is_wrong_and_may_be_corrected(self) -> None:
        value, chat, exchanges = asked(wrong(), calling(1, 2), "3")
        assert value == "3"
        assert "no terms" in chat.requests[1].messages[-1].content
        assert "no terms" in (exchanges[0].problem or "")

    def test_wrong_calls_do_not_go_on_for_ever(self) -> None:
        with pytest.raises(NoValidReplyError, match="no terms"):
            asked(wrong(), wrong(), wrong(), "3")

    def test_a_rejected_answer_after_a_call_keeps_what_was_said(self) -> None:
        value, chat, _ = asked(calling(1, 2), "", "3")
        assert value == "3"
        assert [m.role for m in chat.requests[2].messages] == [
            "user",
            "assistant",
            "tool",
            "assistant",
            "user",
        ]


class TestRecords:
    """Nothing changes for those that know no tools."""

    def test_without_tools_no_field_of_theirs_is_written(self) -> None:
        exchange = Exchange(llm="m", messages=PLAIN.messages, reply=ChatReply(text="3"))
        assert "tool" not in exchange.model_dump_json() + PLAIN.model_dump_json()
        assert "echo" not in exchange.model_dump_json()

    def test_exchanges_with_calls_come_back_whole(self) -> None:
        _, _, exchanges = asked(calling(1, 2), "3")
        for exchange in exchanges:
            assert Exchange.model_validate_json(exchange.model_dump_json()) == exchange


class TestWire:
    @pytest.fixture(autouse=True)
    def keys(self, monkeypatch: pytest.MonkeyPatch) -> None:
        for name in ("ANTHROPIC_API_KEY", "GEMINI_API_KEY", "DEEPSEEK_API_KEY"):
            monkeypatch.setenv(name, "some-secret-key")

    def talk(self, model: str, *, root: bool = False, **extra: Any) -> tuple[str, list[dict[str, Any]]]:
        """Ask, let it call once, answer; return the answer and the bodies of both requests."""
        script = (Step(calls=(("add", {"terms": [1, 2]}),), **extra), Step('{"sum": 3}'))
        with serving(*script) as server:
            chat = LiteLLMChat(model, effort="low", api_base=server.root if root else server.url)
            value = converse(chat, QUESTION, str.strip, lambda _: None, respond=add)
        return value, [r.body for r in server.received]

    @pytest.mark.parametrize("model", ["openai/gpt-5-mini", "openai/mine", "hosted_vllm/mine"])
    def test_openai_servers_get_schema_and_tools(self, model: str) -> None:
        value, (first, second) = self.talk(model)
        assert value == '{"sum": 3}'
        assert "_skip_mcp_handler" not in first
        offered = first["tools"][0]["function"]
        assert (offered["name"], offered["description"]) == ("add", "Adds.")
        assert offered["parameters"]["properties"] == ADD.parameters["properties"]
        assert first["response_format"]["json_schema"]["schema"] == SCHEMA
        assert second["tools"] == first["tools"]
        assert second["response_format"] == first["response_format"]
        call, answer = second["messages"][-2:]
        assert call["role"] == "assistant" and not call.get("content")
        assert call["tool_calls"][0]["function"] == {"name": "add", "arguments": '{"terms": [1, 2]}'}
        assert (answer["role"], answer["tool_call_id"], answer["content"]) == (
            "tool",
            call["tool_calls"][0]["id"],
            "3",
        )

    def test_ollama(self) -> None:
        value, (first, second) = self.talk("ollama_chat/qwen3", root=True)
        assert value == '{"sum": 3}'
        assert first["tools"][0]["function"]["name"] == "add"
        assert second["messages"][-1]["role"] == "tool"
        assert second["messages"][-1]["content"] == "3"

    def test_signed_thoughts_go_back_to_anthropic(self) -> None:
        _, (first, second) = self.talk("anthropic/claude-sonnet-4-5", root=True)
        assert "add" in [tool["name"] for tool in first["tools"]]
        thought, call = second["messages"][-2]["content"]
        assert thought == {"type": "thinking", "thinking": "hm", "signature": "signed"}
        assert call["input"] == {"terms": [1, 2]}
        assert second["messages"][-1]["content"][0]["type"] == "tool_result"

    def test_signatures_go_back_to_gemini(self) -> None:
        _, (first, second) = self.talk("gemini/gemini-2.5-flash")
        assert first["tools"][0]["function_declarations"][0]["name"] == "add"
        (part,) = second["contents"][-2]["parts"]
        assert part["thoughtSignature"] == "signed"

    def test_thoughts_go_back_to_deepseek(self) -> None:
        _, (_, second) = self.talk("deepseek/deepseek-reasoner", extra={"reasoning_content": "hm"})
        assert second["messages"][-2]["reasoning_content"] == "hm"

    def test_calls_count_as_tokens_where_the_server_sends_no_counts(self) -> None:
        with serving(Step(calls=(("add", {"terms": [1] * 200}),), usage=None)) as server:
            usage = LiteLLMChat("openai/mine", api_base=server.url).complete(QUESTION).usage
        assert usage.estimated
        assert usage.completion_tokens > 100
        assert usage.prompt_tokens > len(ADD.model_dump_json()) / 4


REFUSALS = [
    Step(status=400, message="registry/gemma does not support tools"),
    Step(status=400, message='"auto" tool choice requires --enable-auto-tool-choice'),
    Step(status=404, message="No endpoints found that support tool use"),
    Step(status=500, message="tools param requires --jinja flag"),
    Step(status=422, message="function calling is not available"),
]
TOGETHER = Step(
    status=400, message="Function calling with a response mime type: 'application/json' is unsupported"
)


class TestLadder:
    @pytest.mark.parametrize("refusal", REFUSALS, ids=lambda step: step.message)
    def test_refused_tools_are_left_out_and_never_offered_again(self, refusal: Step) -> None:
        with serving(refusal, Step("3"), Step("4")) as server:
            chat = LadderChat(LiteLLMChat("openai/mine", api_base=server.url))
            assert chat.complete(QUESTION).text == "3"
            assert chat.complete(QUESTION).text == "4"
        assert ["tools" in r.body for r in server.received] == [True, False, False]
        assert all("response_format" in r.body for r in server.received)

    def test_where_both_are_refused_together_the_schema_goes_with_tools_only(self) -> None:
        with serving(TOGETHER, TOGETHER, Step("3"), Step("4"), Step("5")) as server:
            chat = LadderChat(LiteLLMChat("openai/mine", api_base=server.url))
            texts = [chat.complete(q).text for q in (QUESTION, QUESTION, PLAIN)]
        assert texts == ["3", "4", "5"]
        assert ["tools" in r.body for r in server.received] == [True, True, True, True, False]
        forms = [r.body.get("response_format", {}).get("type") for r in server.received]
        assert forms == ["json_schema", "json_object", None, None, "json_schema"]

    def test_below_the_last_rung_tools_go(self) -> None:
        with serving(TOGETHER, TOGETHER, TOGETHER, Step("3")) as server:
            assert LadderChat(LiteLLMChat("openai/mine", api_base=server.url)).complete(QUESTION).text == "3"
        assert "tools" not in server.received[-1].body
        assert server.received[-1].body["response_format"]["type"] == "json_schema"

    def test_a_refusal_within_a_turn_is_an_error(self) -> None:
        with serving(Step(calls=(("add", {"terms": [1]}),)), REFUSALS[0]) as server:
            chat = LadderChat(LiteLLMChat("openai/mine", api_base=server.url))
            with pytest.raises(ChatError, match="in the same turn"):
                converse(chat, QUESTION, str.strip, lambda _: None, respond=add)

    def test_the_same_words_mean_nothing_where_no_tool_was_offered(self) -> None:
        with serving(REFUSALS[0]) as server, pytest.raises(ChatError) as caught:
            LiteLLMChat("openai/mine", api_base=server.url).complete(PLAIN)
        assert not isinstance(caught.value, ToolsUnsupportedError)

    def test_the_table_is_believed_where_it_knows_the_model(self) -> None:
        assert may_take_tools("openai/gpt-5-mini")
        assert not may_take_tools("perplexity/sonar")
        assert may_take_tools("openai/never-heard-of")
        assert may_take_tools("perplexity/sonar", api_base="http://127.0.0.1:1/v1")


class Foreteller:
    """Predicts the last value of u as robustness."""

    recent_error = 0.125

    def __init__(self) -> None:
        self.seen: list[Candidate] = []

    def foresee(self, candidates: Sequence[Candidate]) -> list[Verdict]:
        self.seen += candidates
        return [Verdict(c.signals["u"].values[-1], 2.5, "x <= 0.9") for c in candidates]


def tool(calls: int = 3, variant: str = "MP5") -> tuple[PredictionTool, Foreteller]:
    foreteller = Foreteller()
    form = ReplyForm(lag_problem().space, count=MOST_CANDIDATES, reasoned=False)
    what_if = WhatIf(foreteller, calls)
    return (
        PredictionTool(what_if, form, VARIANTS[variant], reveal=lambda c: c, hide=lambda v: v),
        foreteller,
    )


def about(*last: float) -> ToolCall:
    found = [{"signals": [{"name": "u", "values": [0, 0, 0, value]}]} for value in last]
    return ToolCall(id="1", name="predict", arguments=json.dumps({"candidates": found}))


class TestPredictionTool:
    def test_it_tells_robustness_time_predicate_and_error(self) -> None:
        made, foreteller = tool()
        told = made.respond(about(0.5, -0.25))
        assert "Candidate 1: predicted robustness +0.5, decided at about t = 2.5 s by x <= 0.9" in told
        assert "Candidate 2: predicted robustness -0.25" in told
        assert "12 %" in told and "2 more calls" in told
        assert [c.signals["u"].values[-1] for c in foreteller.seen] == [0.5, -0.25]

    def test_only_what_the_variant_tells_of_samples(self) -> None:
        assert "x <= 0.9" not in tool(variant="MP1")[0].respond(about(0.5))
        assert "2.5 s" not in tool(variant="MP3")[0].respond(about(0.5))

    def test_an_invalid_candidate_is_told_why_beside_the_valid_ones(self) -> None:
        told = tool()[0].respond(about(0.5, 7.0))
        assert "Candidate 1: predicted robustness +0.5" in told
        assert "Candidate 2: not predicted: " in told and "7 is outside its range [-1, 1]" in told

    @pytest.mark.parametrize(
        ("call", "problem"),
        [
            (about(7.0), "outside its range"),
            (about(), "neither a JSON object"),
            (ToolCall(id="1", name="simulate", arguments="{}"), "no tool 'simulate', only 'predict'"),
            (ToolCall(id="1", name="predict", arguments='{"candidates": [{"signals": [1'), "neither"),
        ],
    )
    def test_wrong_calls_say_what_is_wrong_and_do_not_count(self, call: ToolCall, problem: str) -> None:
        made, _ = tool(calls=1)
        with pytest.raises(RejectedReplyError, match=problem):
            made.respond(call)
        assert "last call" in made.respond(about(0.5))

    def test_the_limit(self) -> None:
        made, _ = tool(calls=2)
        assert "1 more call can be answered" in made.respond(about(0.5))
        assert "last call" in made.respond(about(0.6))
        with pytest.raises(RejectedReplyError, match="limit of 2 calls is reached"):
            made.respond(about(0.7))

    def test_too_many_candidates_are_cut(self) -> None:
        made, foreteller = tool()
        told = made.respond(about(*(0.01 * i for i in range(30))))
        assert len(foreteller.seen) == MOST_CANDIDATES
        assert "20 more: not predicted" in told

    def test_its_schema_is_strict_and_asks_for_no_rationale(self) -> None:
        item = tool()[0].offer.parameters["properties"]["candidates"]["items"]
        assert list(item["properties"]) == item["required"] == ["signals"]
        assert item["additionalProperties"] is False
