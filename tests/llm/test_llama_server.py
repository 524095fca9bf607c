"""All ways of asking, against llama.cpp's own server, with a language model that answers rubbish."""

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from falsifier.llm.client import LiteLLMChat
from falsifier.llm.conversation import NoValidReplyError, RejectedReplyError, converse
from falsifier.llm.ladder import LadderChat
from falsifier.llm.messages import UNREADABLE, ChatRequest, Exchange, Mode, ToolCall
from tests.command import falsifier
from tests.llm.llama_server import llama_server, needs_llama_server
from tests.llm.support import PLAIN, QUESTION, add
from tests.llm.tiny_model import CALL, FIRST_BYTE, write_tiny_model

# It ends most replies by itself.
SHORT = {"max_tokens": 600}
TEXT = PLAIN.model_copy(
    update={
        "reply_schema": {
            "type": "object",
            "properties": {"why": {"type": "string"}},
            "required": ["why"],
            "additionalProperties": False,
        }
    }
)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    needs_llama_server()
    file = tmp_path_factory.mktemp("llm") / "tiny.gguf"
    write_tiny_model(file)
    return file


@pytest.fixture(scope="module")
def server(model: Path) -> Iterator[str]:
    with llama_server(model, context=16_384) as url:
        yield url


def chat(server: str, mode: Mode = "json_schema", **options: Any) -> LadderChat:
    return LadderChat(LiteLLMChat("openai/tiny", api_base=server, options=SHORT | options, mode=mode))


@pytest.mark.parametrize("question", [PLAIN, QUESTION], ids=["alone", "with-a-tool"])
def test_a_schema_is_enforced(server: str, question: ChatRequest) -> None:
    reply = chat(server).complete(question)
    assert reply.parameters["mode"] == "json_schema"
    assert list(json.loads(reply.text)) == ["sum"]
    assert reply.usage.prompt_tokens > 10 and not reply.usage.estimated


def test_a_json_object_is_enforced(server: str) -> None:
    reply = chat(server, "json_object", seed=1).complete(PLAIN)
    assert isinstance(json.loads(reply.text), dict)


def test_words_come_as_they_are(server: str) -> None:
    reply = chat(server, "prompt").complete(PLAIN)
    assert reply.text and reply.finish_reason in ("stop", "length")


def test_a_reply_that_is_too_long_says_so(server: str) -> None:
    assert chat(server, max_tokens=3).complete(PLAIN).finish_reason == "length"


def test_calls_of_a_tool_are_read_and_their_answers_sent(server: str) -> None:
    exchanges: list[Exchange] = []

    def respond(call: ToolCall) -> str:
        if len(exchanges) > 0:
            raise RejectedReplyError("that was the last call")
        return add(call)

    eager = chat(server, "prompt", logit_bias={str(CALL): 24.0})
    with suppress(NoValidReplyError):
        converse(eager, QUESTION, str.strip, exchanges.append, respond=respond, reasks=0)
    first, second = exchanges[:2]
    assert first.reply is not None and second.reply is not None
    assert first.reply.tool_calls[0].name == "add"
    assert list(json.loads(first.reply.tool_calls[0].arguments)) == ["terms"]
    assert [m.role for m in second.messages[:3]] == ["user", "assistant", "tool"]


def test_a_reply_that_the_server_cannot_parse_is_one_that_cannot_be_used(server: str) -> None:
    not_utf8 = {str(FIRST_BYTE + 0xFF): 24.0}
    ladder = chat(server, logit_bias=not_utf8)
    replies = [ladder.complete(TEXT) for _ in range(2)]
    assert [reply.finish_reason for reply in replies] == [UNREADABLE, UNREADABLE]
    assert ladder.mode == "json_object"


def test_a_run_with_rubbish_for_answers_ends_properly(server: str, tmp_path: Path) -> None:
    done = falsifier(
        *("run", "python:tests.problems:impossible", "--llm", "openai/tiny", "--api-base", server),
        *("--variant", "MP1", "--budget", "2", "--out", "run", "--llm-option", "max_tokens=200"),
        cwd=tmp_path,
        env={"XDG_CACHE_HOME": "cache"},
    )
    assert done.code == 0, done.err
    assert "not falsified after 2 simulations" in done.out
    assert "language model" in done.out


def test_a_prompt_beyond_the_servers_context_is_never_cut(model: Path, tmp_path: Path) -> None:
    with llama_server(model, context=256) as url:
        done = falsifier(
            *("run", "python:tests.problems:impossible", "--llm", "openai/tiny", "--api-base", url),
            *("--budget", "2", "--out", "run"),
            cwd=tmp_path,
            env={"XDG_CACHE_HOME": "cache"},
        )
    assert done.code == 3
    for part in ("the prompt is too long", "llama.cpp: --ctx-size", "(256 tokens)"):
        assert part in done.out, part
    assert "litellm" not in done.out
