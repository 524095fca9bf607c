"""What goes over the wire for each provider, and what is made of what comes back."""

import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

import falsifier
from falsifier.errors import ChatError
from falsifier.llm import client
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.failures import FormatUnsupportedError, TransientChatError
from falsifier.llm.json_text import schema_of_object
from falsifier.llm.messages import ChatRequest, Message, Usage
from falsifier.llm.providers import first_mode
from falsifier.llm.usage import Price, count_tokens
from tests.hostile.servers import answers, hangs, misbehaving, response, sends
from tests.llm.server import Step, serving

SCHEMA = schema_of_object(rationale={"type": "string"})
STRICT = {"type": "json_schema", "json_schema": {"name": "reply", "strict": True, "schema": SCHEMA}}
REQUEST = ChatRequest(
    messages=(Message(role="system", content="standing"), Message(role="user", content="question")),
    reply_schema=SCHEMA,
)
KEYS = {
    "OPENAI_API_KEY": "sk-openai-secret",
    "HF_TOKEN": "hf_secret_token",
    "ANTHROPIC_API_KEY": "sk-ant-secret",
    "GEMINI_API_KEY": "gemini-secret",
    "OPENROUTER_API_KEY": "openrouter-secret",
}


@pytest.fixture(autouse=True)
def _keys(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in KEYS.items():
        monkeypatch.setenv(name, value)


@dataclass(frozen=True)
class Wire:
    """One provider: its model string and what must arrive."""

    model: str
    body: dict[str, Any]
    path: str = "/v1/chat/completions"
    header: tuple[str, str] | None = ("authorization", "Bearer none")
    absent: tuple[str, ...] = ()
    base: str = "v1"
    options: dict[str, Any] = field(default_factory=dict)


GPT_OSS = {"model": "openai/gpt-oss-20b", "reasoning_effort": "low", "response_format": STRICT}
WIRES = [
    Wire(
        "openai/gpt-5-mini",
        {"model": "gpt-5-mini", "reasoning_effort": "low", "response_format": STRICT},
        header=("authorization", "Bearer sk-openai-secret"),
        absent=("temperature",),
        options={"temperature": 0.5},
    ),
    Wire("hosted_vllm/openai/gpt-oss-20b", GPT_OSS, header=None),
    Wire("huggingface/openai/gpt-oss-20b", GPT_OSS, header=("authorization", "Bearer hf_secret_token")),
    Wire(
        "ollama_chat/gpt-oss:20b",
        {"model": "gpt-oss:20b", "think": "low", "options": {"num_ctx": 32_768}},
        path="/api/chat",
        header=None,
        absent=("format",),
        base="",
    ),
    Wire(
        "ollama_chat/qwen3",
        {"model": "qwen3", "format": SCHEMA, "options": {"num_ctx": 8192}},
        path="/api/chat",
        header=None,
        base="",
        options={"num_ctx": 8192},
    ),
    Wire(
        "lm_studio/gpt-oss-20b",
        {"model": "gpt-oss-20b", "reasoning_effort": "low"},
        absent=("response_format",),
    ),
    Wire("lm_studio/qwen", {"model": "qwen", "response_format": STRICT}),
    Wire("llamafile/any", {"model": "any", "response_format": STRICT}, absent=("reasoning_effort",)),
    Wire(
        "openrouter/openai/gpt-5-mini",
        {"model": "openai/gpt-5-mini", "reasoning_effort": "low", "response_format": STRICT},
        header=("authorization", "Bearer openrouter-secret"),
    ),
    Wire(
        "anthropic/claude-sonnet-4-5",
        {"model": "claude-sonnet-4-5"},
        path="/v1/messages",
        header=("x-api-key", "sk-ant-secret"),
        base="",
    ),
    Wire(
        "gemini/gemini-2.5-flash",
        {},
        path="/v1/models/gemini-2.5-flash:generateContent",
        header=("x-goog-api-key", "gemini-secret"),
    ),
]


@pytest.mark.parametrize("wire", WIRES, ids=lambda w: w.model)
def test_what_is_sent(wire: Wire) -> None:
    with serving(Step("an answer")) as server:
        base, mode = server.url if wire.base else server.root, first_mode(wire.model)
        chat = LiteLLMChat(wire.model, effort="low", api_base=base, options=wire.options, mode=mode)
        reply = chat.send(REQUEST)
    (received,) = server.received
    assert reply.text == "an answer"
    assert received.path == wire.path
    assert {k: received.body.get(k) for k in wire.body} == wire.body
    assert not {*wire.absent, "max_retries"} & received.body.keys()
    assert "question" in str(received.body) and "standing" in str(received.body)
    if wire.header is not None:
        assert received.headers[wire.header[0]] == wire.header[1]
    assert (reply.usage.prompt_tokens, reply.usage.completion_tokens) == (100, 20)
    # What every request has whose reply is limited and whose connection can be cut.
    assert received.headers["accept-encoding"] == "identity"


def test_effective_parameters_name_what_was_dropped() -> None:
    warm = {"temperature": 0.5}
    with serving(Step("a"), Step("b")) as server:
        known = LiteLLMChat("openai/gpt-5-mini", effort="low", api_base=server.url, options=warm)
        other = LiteLLMChat("openai/other", api_base=server.url, options=warm)
        dropped, kept = known.send(REQUEST).parameters, other.send(REQUEST).parameters
    assert dropped["dropped"] == ["temperature"]
    assert "temperature" not in dropped
    assert (dropped["effort"], dropped["mode"]) == ("low", "json_schema")
    assert kept["temperature"] == 0.5 and "dropped" not in kept


def test_cost_of_another_server_is_unknown_and_of_a_local_one_nothing() -> None:
    uncounted = Step(usage={"prompt_tokens": 0, "completion_tokens": 0})
    with serving(*map(Step, "abcd"), uncounted) as server:
        foreign = LiteLLMChat("openai/gpt-5-mini", api_base=server.url).send(REQUEST)
        hosted = LiteLLMChat("huggingface/openai/gpt-oss-20b", api_base=server.url).send(REQUEST)
        local = LiteLLMChat("ollama_chat/qwen3", api_base=server.root).send(REQUEST)
        priced = LiteLLMChat("openai/gpt-5-mini", api_base=server.url, price=Price(0.25, 2.0)).send(REQUEST)
        estimated = LiteLLMChat("hosted_vllm/x", api_base=server.url).send(REQUEST)
    assert [r.usage.cost for r in (foreign, hosted, estimated)] == [None] * 3
    assert estimated.usage.estimated and estimated.usage.completion_tokens > 5
    assert local.usage.cost == 0
    assert priced.usage.cost == pytest.approx((100 * 0.25 + 20 * 2.0) / 1e6)


def test_reasoning_and_refusals_are_told_apart() -> None:
    refusal = Step(None, extra={"refusal": "I would rather not"})
    counts: dict[str, Any] = {"prompt_tokens": 100, "completion_tokens": 20}
    counts["prompt_tokens_details"] = {"cached_tokens": 64}
    counts["completion_tokens_details"] = {"reasoning_tokens": 12}
    ended = "model_context_window_exceeded"
    answer = Step(ended, extra={"reasoning_content": "first I thought"}, usage=counts, finish=ended)
    with serving(answer, refusal, answer) as server:
        chat = LiteLLMChat("openai/mine", api_base=server.url)
        first, second = chat.send(REQUEST), chat.send(REQUEST)
        other = LiteLLMChat("anthropic/claude-sonnet-4-5", api_base=server.root).send(REQUEST)
    assert (first.reasoning, first.usage.reasoning_tokens) == ("first I thought", 12)
    for reply in (first, other):
        assert (reply.finish_reason, reply.text) == ("length", ended), "it was cut off, and says what it says"
    assert (first.usage.cached_tokens, (first.usage + first.usage).cached_tokens) == (64, 128)
    assert (second.finish_reason, second.text) == ("refusal", "I would rather not")


def test_an_answer_in_a_call_of_a_tool_that_nobody_offered_is_the_answer() -> None:
    call = {"id": "1", "type": "function", "function": {"name": "json", "arguments": '{"rationale": ""}'}}
    with serving(Step(None, extra={"tool_calls": [call]}, finish="tool_calls")) as server:
        reply = LiteLLMChat("openai/mine", api_base=server.url).send(REQUEST)
    assert reply.text == '{"rationale": ""}' and reply.finish_reason == "call of the tool 'json'"


def test_a_text_in_parts_or_as_an_object_is_read_as_one() -> None:
    halves = [{"type": "text", "text": half} for half in ('{"ration', 'ale": ""}')]
    parts = [{"type": "thinking", "thinking": []}, *halves]
    steps = [Step(None, extra={"content": content}) for content in (parts, {"rationale": ""}, [7])]
    with serving(*steps) as server:
        chat = LiteLLMChat("openai/mine", api_base=server.url)
        replies = [chat.send(REQUEST) for _ in range(2)]
        with pytest.raises(TransientChatError, match="does not have the form"):
            chat.send(REQUEST)
    assert [(r.text, r.usage.prompt_tokens) for r in replies] == [('{"rationale": ""}', 100)] * 2


_TEXTS = [message.content for message in REQUEST.messages]


@pytest.mark.parametrize(
    ("counts", "sent", "received"),
    [
        ({"prompt_tokens": "many", "completion_tokens": None}, None, None),
        ({"prompt_tokens": 100.0, "completion_tokens": 20.5, "total_tokens": True}, 100, None),
        ({"prompt_tokens": 100, "completion_tokens": None}, 100, None),
        ({"prompt_tokens": 7, "completion_tokens": 8, "prompt_tokens_details": {"cached_tokens": "x"}}, 7, 8),
        ({"prompt_tokens": 7, "completion_tokens": 8, "cost": 0.5, "total_tokens": 15}, 7, 8),
        (["many"], None, None),
        (None, None, None),
    ],
    ids=str,
)
def test_counts_of_a_wrong_form_are_counted_here(counts: Any, sent: int | None, received: int | None) -> None:
    with serving(Step("some words", usage=counts)) as server:
        reply = LiteLLMChat("openai/mine", api_base=server.url, price=Price(1.0, 1.0)).send(REQUEST)
    own = [sum(count_tokens(text, "openai/mine") for text in texts) for texts in (_TEXTS, ["some words"])]
    usage = reply.usage
    assert reply.text == "some words" and usage.estimated == (None in (sent, received))
    assert (usage.prompt_tokens, usage.completion_tokens) == (sent or own[0], received or own[1])
    assert usage.cost == pytest.approx(usage.tokens / 1e6)


@pytest.mark.parametrize(
    ("sent", "count"),
    [
        (response(b'{"choices": []}'), 1),
        (response(b'{"choices": []}')[:-2], 1),  # it closes the connection within its answer
        (response(b'{"id": "1"}'), 1),
        (response(b'{"error": "x"}'), 0),
        (response(b"<p>x</p>"), 0),
    ],
)
def test_an_answer_that_cannot_be_used_is_counted(sent: bytes, count: int) -> None:
    with misbehaving(sends(sent)) as server, pytest.raises(TransientChatError) as caught:
        LiteLLMChat("openai/mine", api_base=server.url, price=Price(1.0, 1.0)).send(REQUEST)
    lost = caught.value.lost or Usage()
    assert lost.without_reply == count and bool(lost.prompt_tokens) == bool(lost.cost) == bool(count)


def test_without_time_nothing_is_sent_and_the_server_is_not_blamed() -> None:
    with serving(Step("{}")) as server:
        with pytest.raises(ChatError, match="nothing was sent: the time limit ended"):
            LiteLLMChat("openai/mine", api_base=server.url).send(REQUEST.model_copy(update={"deadline": 0.0}))
        assert not server.received


FAILURES: list[tuple[Step, type[ChatError] | None, str]] = [
    (Step(status=429, headers={"Retry-After": "7"}), TransientChatError, ""),
    (Step(status=429, message="exceeded your current quota. Retry in 0m7.0s."), TransientChatError, ""),
    (Step(status=429, message="Please try again in 7000ms. See settings/billing"), TransientChatError, ""),
    (Step(status=503), TransientChatError, ""),
    (Step(hang_up=True), TransientChatError, ""),
    (Step(raw="<html>Bad gateway</html>"), TransientChatError, "Bad gateway"),
    (Step(status=401, message="bad key sk-openai-secret"), None, "check "),
    (Step(status=400, message="response_format json_schema unsupported"), FormatUnsupportedError, ""),
    (Step(status=429, message="insufficient_quota: check your billing"), None, "no quota left"),
]


@pytest.mark.parametrize("model", ["openai/mine", "hosted_vllm/mine", "huggingface/org/mine"])
@pytest.mark.parametrize(("step", "kind", "said"), FAILURES, ids=lambda v: getattr(v, "status", None) or "")
def test_one_request_is_one_request(step: Step, kind: type[ChatError] | None, said: str, model: str) -> None:
    """Nothing is sent again behind our back, and each failure is what it is."""
    with serving(step, Step("never seen")) as server, pytest.raises(ChatError) as caught:
        LiteLLMChat(model, api_base=server.url).send(REQUEST)
    assert type(caught.value) is (kind or ChatError)
    assert str(caught.value).startswith(f"{model} at ") and said in str(caught.value)
    assert "sk-openai-secret" not in str(caught.value)
    assert len(server.received) == 1
    if step.status == 429 and isinstance(caught.value, TransientChatError):
        assert caught.value.retry_after == 7


@pytest.mark.parametrize("model", ["openai/mine", "hosted_vllm/mine"])
def test_a_request_without_an_answer_in_time_is_counted(model: str) -> None:
    with misbehaving(answers(), hangs()) as server:
        LiteLLMChat(model, api_base=server.url).send(REQUEST)  # the first one imports for a while
        with pytest.raises(TransientChatError) as caught:
            LiteLLMChat(model, api_base=server.url, timeout=2).send(REQUEST)
    assert caught.value.lost is not None
    assert caught.value.lost.without_reply == 1 and caught.value.lost.prompt_tokens > 0
    assert len(server.requests) == 2


def test_a_request_that_is_interrupted_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "within", Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt) as stopped:
        LiteLLMChat("openai/mine", api_base="http://127.0.0.1:9").complete(REQUEST)
    assert getattr(stopped.value, "lost", Usage()).without_reply == 1


_QUIET = """
import socket, sys
reached = []
connect, resolve = socket.socket.connect, socket.getaddrinfo

def watched_connect(self, address):
    if self.family in (socket.AF_INET, socket.AF_INET6) and address[0] != "127.0.0.1":
        reached.append(address)
        raise OSError("closed")
    return connect(self, address)

def watched_resolve(host, *args, **kwargs):
    if host not in ("127.0.0.1", "localhost", None):
        reached.append(host)
        raise OSError("closed")
    return resolve(host, *args, **kwargs)

socket.socket.connect, socket.getaddrinfo = watched_connect, watched_resolve
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.messages import ChatRequest, Message, Usage
request = ChatRequest(messages=(Message(role="user", content="?"),))
for model, base in zip(sys.argv[1::2], sys.argv[2::2]):
    LiteLLMChat(model, effort="low", api_base=base).send(request)
import os, time
time.sleep(0.5)
print(reached, os.environ.get("FROM_DOTENV"))
"""


def test_nothing_else_is_reached_printed_or_read(tmp_path: Path) -> None:
    """No price list, no telemetry, no .env: only the server that was named hears of us."""
    (tmp_path / ".env").write_text("FROM_DOTENV=read\n")
    (tmp_path / "quiet.py").write_text(_QUIET)
    with serving(Step("a"), Step("b"), Step("c", finish="load")) as server:
        models = ["openai/gpt-5-mini", server.url, "anthropic/claude-sonnet-4-5", server.root]
        models += ["ollama_chat/qwen3", server.root]
        root = str(Path(falsifier.__file__).parent.parent)
        done = subprocess.run(
            [sys.executable, "quiet.py", *models],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": root, "ANTHROPIC_API_KEY": "sk-ant-none"},
            capture_output=True,
            text=True,
            check=True,
        )
        assert len(server.received) == 3
    assert done.stdout == "[] None\n"
    assert done.stderr == ""


KEPT = ChatRequest(
    messages=(
        Message(role="system", content="standing", stable=8),
        Message(role="user", content="samples and news", stable=7),
    )
)


def test_what_the_next_question_begins_with_is_marked_where_a_provider_keeps_nothing_else() -> None:
    with serving(Step("a"), Step("b")) as server:
        LiteLLMChat("anthropic/claude-sonnet-4-5", api_base=server.root).send(KEPT)
        LiteLLMChat("openai/mine", api_base=server.url).send(KEPT)
    marked, plain = (r.body for r in server.received)
    mark = {"type": "ephemeral"}
    assert marked["system"] == [{"type": "text", "text": "standing", "cache_control": mark}]
    (user,) = marked["messages"]
    assert [(part["text"], part.get("cache_control")) for part in user["content"]] == [
        ("samples", mark),
        (" and news", None),
    ]
    assert plain["messages"] == [
        {"role": "system", "content": "standing"},
        {"role": "user", "content": "samples and news"},
    ]


def test_ladder_finds_the_form_that_a_server_takes_and_remembers_it() -> None:
    refused = Step(status=400, message="response_format is not supported")
    with serving(refused, refused, Step("in words"), Step("again")) as server:
        chat = LiteLLMChat("openai/m", api_base=server.url)
        first, second = chat.complete(REQUEST), chat.complete(REQUEST)
    kinds = [r.body.get("response_format", {}).get("type") for r in server.received]
    assert kinds == ["json_schema", "json_object", None, None]
    assert first.parameters["mode"] == "prompt"
    assert second.text == "again"


UNPARSED = [
    Step(status=500, message="The model produced output that does not match the expected peg-native format"),
    Step(status=500, message="Failed to parse input at pos 12: <tool_call>{"),
    Step(status=400, message='Failed to generate JSON. See {"failed_generation": {"top_k": 1}}'),
]


@pytest.mark.parametrize("unparsed", UNPARSED, ids=lambda step: step.message)
def test_what_a_server_cannot_parse_twice_is_asked_for_more_plainly(unparsed: Step) -> None:
    with serving(unparsed, Step("one"), unparsed, unparsed, Step("two")) as server:
        chat = LiteLLMChat("openai/m", api_base=server.url, options={"top_k": 3})  # which it may write of
        texts = [chat.complete(REQUEST).text for _ in range(5)]
    assert texts == ["", "one", "", "", "two"]
    kinds = [r.body["response_format"]["type"] for r in server.received]
    assert kinds == ["json_schema"] * 4 + ["json_object"]


def test_ladder_ends_at_its_last_rung() -> None:
    refused = Step(status=400, message="grammar is not supported")
    samplers = Step(status=400, message="Failed to initialize samplers: std::exception")
    with serving(samplers, refused, refused) as server, pytest.raises(ChatError, match="grammar"):
        LiteLLMChat("openai/m", api_base=server.url).complete(REQUEST)
    assert len(server.received) == 3
