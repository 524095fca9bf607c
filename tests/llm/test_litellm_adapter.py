"""What the client library is given, and what it may do when it is imported."""

from typing import Any

import pytest

from falsifier.llm.client import LiteLLMChat, sent_message
from falsifier.llm.conversation import converse
from falsifier.llm.litellm_adapter import listed_price
from falsifier.llm.messages import Message, ToolCall
from tests.llm.server import Step, serving
from tests.llm.support import ADD, QUESTION, SCHEMA, add


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

    @pytest.mark.parametrize("arguments", ['{"terms": [1', '{"terms": [87E787055]}', '{"terms": [NaN]}'])
    def test_calls_that_are_no_json_are_sent_back_without_their_arguments(self, arguments: str) -> None:
        calls = (ToolCall(id="1", name="add", arguments=arguments),)
        sent = sent_message(Message(role="assistant", content="", tool_calls=calls))
        assert sent["tool_calls"][0]["function"] == {"name": "add", "arguments": "{}"}

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


def test_prices() -> None:
    listed = listed_price("openai/gpt-5-mini")
    assert listed is not None and 0 < listed.prompt < listed.completion
    assert listed_price("huggingface/openai/gpt-oss-20b") is None
    assert listed_price("openai/never-heard-of") is None


def test_tools_that_litellm_drops_are_not_recorded_as_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PERPLEXITYAI_API_KEY", "some-secret-key")
    with serving(Step('{"sum": 3}')) as server:
        sent = LiteLLMChat("perplexity/sonar", api_base=server.url).complete(QUESTION).parameters
    assert "tools" not in sent and sent["dropped"] == ["tools"]
    assert "tools" not in server.received[0].body
