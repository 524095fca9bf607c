"""Servers of language models that hang, trickle, send garbage or redirect: every call ends, and in time."""

import json
import threading
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from falsifier.engines.llm import make_llm_engine
from falsifier.errors import ChatError
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.connect import connect
from falsifier.llm.messages import ChatReply, ChatRequest, Message
from falsifier.search.budget import Budget
from falsifier.search.result import Result
from falsifier.search.run import falsify
from falsifier.testing import lag_problem
from tests.hostile.servers import (
    GOOD,
    Behaviour,
    answers,
    completion,
    hangs,
    in_turn,
    misbehaving,
    response,
    sends,
    trickles,
)
from tests.patience import HANG

REQUEST = ChatRequest(messages=(Message(role="user", content="a question"),))
HEAD = b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\n"
CHUNKED = HEAD + b"transfer-encoding: chunked\r\n\r\n"

ENDLESS: dict[str, Behaviour] = {
    "silence": hangs(),
    "half a status line": hangs(b"HTTP/1.1 2"),
    "headers only": hangs(HEAD),
    "no body": hangs(HEAD + b"content-length: 100\r\n\r\n"),
    "half a body": hangs(response(completion(GOOD))[:-20]),
    "half a chunk": hangs(CHUNKED + b'ff\r\n{"id"'),
    "a slow status line": trickles(b"HTTP/1.1 200 OK"),
    "slow headers": in_turn(sends(HEAD), trickles(b"x-header: value\r\n")),
    "interim responses": trickles(b"HTTP/1.1 100 Continue\r\n\r\n", period=0.0001),
    "a slow body": in_turn(sends(HEAD + b"content-length: 1000000\r\n\r\n"), trickles(b" ")),
    "slow chunks": in_turn(sends(CHUNKED), trickles(b"1\r\n \r\n")),
    "a body without end": in_turn(sends(HEAD + b"\r\n"), trickles(b" ")),
}


@pytest.fixture(autouse=True, scope="module")
def _warm_up() -> None:
    """The first request imports much, which takes seconds."""
    with misbehaving(answers()) as server:
        LiteLLMChat("openai/m", api_base=server.url).complete(REQUEST)


def ended(action: Callable[[], Any]) -> list[Any]:
    """What an action returned or raised; empty if it has not ended."""
    outcome: list[Any] = []

    def work() -> None:
        try:
            outcome.append(action())
        except BaseException as error:
            outcome.append(error)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(HANG)
    return outcome


@pytest.mark.parametrize("behaviour", ENDLESS)
def test_a_request_ends_in_time_and_is_cut(behaviour: str) -> None:
    with misbehaving(ENDLESS[behaviour]) as server:
        chat = LiteLLMChat("openai/m", api_base=server.url, timeout=0.5)
        (error,) = ended(lambda: chat.complete(REQUEST))
        assert isinstance(error, ChatError)
        assert server.gone.wait(HANG)


def run(url: str, **budget: Any) -> Result:
    problem = lag_problem()
    chat = connect("openai/m", api_base=url)
    return falsify(problem, make_llm_engine(problem, chat, variant="MP4"), budget=Budget(**budget))


@pytest.mark.parametrize("behaviour", ["silence", "a slow body"])
def test_the_seconds_of_a_run_hold(behaviour: str) -> None:
    with misbehaving(ENDLESS[behaviour]) as server:
        (result,) = ended(lambda: run(server.url, simulations=5, seconds=1.0))
        assert isinstance(result, Result), result
        assert (result.status, result.reason) == ("not falsified", "the time limit of 1 s is reached")
        assert server.requests
        assert server.gone.wait(HANG)


@pytest.mark.parametrize(
    "refusal",
    [
        response(b"{}", status="429 Too Many Requests", headers="retry-after: 100\r\n"),
        response(b"{}", status="503 Service Unavailable"),
        b"",
    ],
    ids=["wait", "unavailable", "hang up"],
)
def test_the_seconds_of_a_run_hold_if_the_server_asks_to_wait(refusal: bytes) -> None:
    with misbehaving(sends(refusal)) as server:
        (result,) = ended(lambda: run(server.url, simulations=5, seconds=2.0))
    assert isinstance(result, Result), result
    assert result.status == "failed" and "no time is left" in result.reason


ANY_BYTES = st.binary(max_size=200)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)


def altered(key: str, value: Any) -> bytes:
    body = json.loads(completion(GOOD))
    holder = body["choices"][0] if key in body["choices"][0] else body
    holder = holder["message"] if key in holder.get("message", {}) else holder
    holder[key] = value
    return json.dumps(body).encode()


KEYS = st.sampled_from(
    ["id", "created", "model", "choices", "usage", "index", "message", "finish_reason", "content", "role"]
)
BODIES = st.one_of(
    ANY_BYTES,
    JSON.map(lambda found: json.dumps(found).encode()),
    st.tuples(KEYS, JSON).map(lambda two: altered(*two)),
    st.integers(0, 300).map(lambda n: completion(GOOD)[:n]),
    st.integers(1, 100_000).map(lambda n: b"[" * n),
    st.integers(1, 6000).map(lambda n: b'{"id": ' + b"9" * n + b"}"),
)
RESPONSES = st.one_of(
    ANY_BYTES,
    ANY_BYTES.map(lambda junk: HEAD + junk),
    ANY_BYTES.map(lambda junk: CHUNKED + junk),
    st.tuples(BODIES, st.sampled_from([200, 204, 301, 304, 400, 401, 404, 422, 500, 999])).map(
        lambda two: response(two[0], status=f"{two[1]} x")
    ),
    BODIES.map(lambda body: response(body, headers="content-encoding: gzip\r\n")),
    BODIES.map(lambda body: response(body, headers="set-cookie: \xe4\r\nlocation: http://[\r\n")),
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(RESPONSES)
@example(response(b"[" * 2060, status="301 x"))
def test_any_response_is_a_reply_or_an_error_that_says_so(data: bytes) -> None:
    with misbehaving(sends(data)) as server:
        (found,) = ended(lambda: LiteLLMChat("openai/m", api_base=server.url, timeout=20.0).complete(REQUEST))
    assert isinstance(found, ChatReply | ChatError), found


def test_a_reply_that_never_ends_is_refused_by_its_size() -> None:
    with misbehaving(in_turn(sends(HEAD + b"\r\n"), trickles_of(b" " * 65536))) as server:
        chat = LiteLLMChat("openai/m", api_base=server.url, timeout=HANG)
        (error,) = ended(lambda: chat.complete(REQUEST))
        assert "more than 16 MiB" in str(error)
        assert server.gone.wait(HANG)


def trickles_of(block: bytes) -> Behaviour:
    def behave(connection: Any, _request: bytes, closed: threading.Event) -> None:
        while not closed.is_set():
            connection.sendall(block)

    return behave


def test_a_compressed_reply_is_not_unpacked() -> None:
    with misbehaving(sends(response(b"\x1f\x8b", headers="content-encoding: gzip\r\n"))) as server:
        (error,) = ended(lambda: LiteLLMChat("openai/m", api_base=server.url).complete(REQUEST))
    assert "the reply is compressed (gzip)" in str(error)


@pytest.mark.parametrize("status", [301, 302, 303, 307, 308])
def test_no_prompt_follows_a_redirect_to_another_server(status: int) -> None:
    with misbehaving(answers()) as other:
        moved = response(b"", status=f"{status} Moved", headers=f"location: {other.url}/chat/completions\r\n")
        with misbehaving(sends(moved)) as server:
            (error,) = ended(lambda: connect("openai/m", api_base=server.url).complete(REQUEST))
            assert len(server.requests) == 1
        assert not other.requests
    assert isinstance(error, ChatError)
    assert f"redirects to {other.root}" in str(error) and "--api-base" in str(error)


def test_a_redirect_within_the_server_is_followed() -> None:
    moved = response(b"", status="307 Temporary Redirect", headers="location: /v2/chat/completions\r\n")
    with misbehaving(sends(moved), answers("fine")) as server:
        assert LiteLLMChat("openai/m", api_base=server.url).complete(REQUEST).text == "fine"
    assert b"/v2/chat/completions" in server.requests[1].split(b"\r\n")[0]
