"""Servers of language models that hang, trickle, send garbage or redirect: every call ends, and in time."""

import socket
import struct
import threading
from collections.abc import Callable
from typing import Any

import pytest

from falsifier.engines.llm import LLMEngine
from falsifier.errors import ChatError
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.connect import connect
from falsifier.record.run import falsify
from falsifier.search.budget import Budget
from falsifier.search.result import Result
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
from tests.llm.support import PLAIN
from tests.patience import HANG

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
        LiteLLMChat("openai/m", api_base=server.url).send(PLAIN)


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
        (error,) = ended(lambda: chat.send(PLAIN))
        assert isinstance(error, ChatError)
        assert server.gone.wait(HANG)


def run(url: str, **budget: Any) -> Result:
    problem = lag_problem()
    chat = connect("openai/m", api_base=url)
    return falsify(problem, LLMEngine(problem, chat, variant="MP4"), budget=Budget(**budget))


@pytest.mark.parametrize("behaviour", ENDLESS)
def test_the_seconds_of_a_run_hold(behaviour: str) -> None:
    with misbehaving(ENDLESS[behaviour]) as server:
        (result,) = ended(lambda: run(server.url, simulations=5, seconds=1.0))
        assert isinstance(result, Result), result
        assert result.status == "failed" and not result.evaluations
        assert "the time limit of 1 s is reached; the language model gave no usable answer: " in result.reason
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


def test_a_reply_that_never_ends_is_refused_by_its_size() -> None:
    with misbehaving(in_turn(sends(HEAD + b"\r\n"), trickles_of(b" " * 65536))) as server:
        chat = LiteLLMChat("openai/m", api_base=server.url, timeout=HANG)
        (error,) = ended(lambda: chat.send(PLAIN))
        assert "more than 16 MiB" in str(error)
        assert server.gone.wait(HANG)


def trickles_of(block: bytes) -> Behaviour:
    def behave(connection: Any, _request: bytes, closed: threading.Event) -> None:
        while not closed.is_set():
            connection.sendall(block)

    return behave


def test_a_compressed_reply_is_not_unpacked() -> None:
    with misbehaving(sends(response(b"\x1f\x8b", headers="content-encoding: gzip\r\n"))) as server:
        (error,) = ended(lambda: LiteLLMChat("openai/m", api_base=server.url).send(PLAIN))
    assert "the reply is compressed (gzip)" in str(error)


@pytest.mark.parametrize("status", [301, 302, 303, 307, 308])
@pytest.mark.parametrize(
    "path", ["/v2/chat/completions", "/v1/chat/completions", ""], ids=["on", "loop", "-"]
)
def test_no_prompt_follows_a_redirect(status: int, path: str) -> None:
    with misbehaving(answers()) as other:
        place = f"{other.root}{path}" if path == "/v2/chat/completions" else path
        header = f"location: {place}\r\n" if path else ""
        with misbehaving(sends(response(b"", status=f"{status} Moved", headers=header))) as server:
            (error,) = ended(lambda: connect("openai/m", api_base=server.url).complete(PLAIN))
            assert len(server.requests) == 1
        assert not other.requests
    assert isinstance(error, ChatError)
    assert ("redirects to the same address" in str(error)) is ("v2" not in path)
    assert (f"api_base={other.root}/v2" in str(error)) is ("v2" in path)


def resets(after: bytes) -> Behaviour:
    """Send something and cut the connection without closing it."""

    def behave(connection: socket.socket, _request: bytes, _closed: threading.Event) -> None:
        connection.sendall(after)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

    return behave


BROKEN: dict[str, tuple[Behaviour, str]] = {
    "reset": (resets(b""), "connection was cut"),
    "hang up": (sends(b""), "closed the connection without a reply"),
    "reset in the body": (resets(HEAD + b"content-length: 100\r\n\r\n{"), "connection was cut"),
    "end in the body": (sends(HEAD + b"content-length: 100\r\n\r\n{"), "cut within the reply"),
    "end in a chunk": (sends(CHUNKED + b"ff\r\n{"), "cut within the reply"),
    "oversized headers": (sends(HEAD + b"x: " + b"a" * 300_000 + b"\r\n\r\n{}"), "headers of more than"),
    "no http": (sends(b"\x15\x03\x01\x00\x02\x02\x46"), "does not answer in HTTP"),
    "chunk garbage": (sends(CHUNKED + b"zz\r\nhello\r\n"), "no valid HTTP"),
    "half a JSON": (sends(response(b'{"id": ')), "not JSON (it begins with '{\"id\":')"),
    "a page": (sends(response(b"<html><body>Sign in</body></html>")), "not JSON (it begins with '<html>"),
    "nothing": (sends(response(b"")), "not JSON (it is empty)"),
    "no text": (sends(response(b"\xff\xfe\x00")), "not JSON (it begins with"),
    "depth": (sends(response(b"[" * 100_000)), "nested too deeply"),
    "no choices": (sends(response(b'{"id": "1", "choices": []}')), "without any choice"),
    "an endless error": (
        in_turn(sends(HEAD.replace(b"200", b"500") + b"\r\n"), trickles_of(b"not loaded " * 6000)),
        "not loaded not loaded",
    ),
    "an error as text": (sends(response(b'{"error": "model not loaded"}')), "model not loaded"),
    "a page of a proxy": (
        sends(response(b"<html>\n<title>502 Bad Gateway</title>\n</html>", status="502 x")),
        "502 Bad Gateway",
    ),
}


@pytest.mark.parametrize("llm", ["openai/m", "hosted_vllm/m"])
@pytest.mark.parametrize("what", BROKEN)
def test_a_reply_that_is_none_is_told_with_its_cause_and_cure_in_one_line(what: str, llm: str) -> None:
    behaviour, cause = BROKEN[what]
    with misbehaving(behaviour) as server:
        (error,) = ended(lambda: LiteLLMChat(llm, api_base=server.url, timeout=HANG).send(PLAIN))
        assert isinstance(error, ChatError)
        told = str(error)
        assert told.startswith(f"{llm} at {server.url}: ") and "\n" not in told
    assert cause in told
    assert "<class" not in told and "bytearray" not in told and not told.endswith("Connection error")
    if "502" not in cause and "loaded" not in cause:
        assert "check" in told or "its log" in told


def test_a_reply_with_bytes_that_are_no_characters_is_read() -> None:
    with misbehaving(sends(response(completion("QQ").replace(b"QQ", b"10 \xb0C")))) as server:
        reply = LiteLLMChat("openai/m", api_base=server.url).send(PLAIN)
    assert reply.text == "10 \N{REPLACEMENT CHARACTER}C"


def test_https_to_a_server_without_tls_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def answer() -> None:
            connection, _ = listening.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(b"HTTP/1.1 400 Bad\r\n\r\n")

        threading.Thread(target=answer, daemon=True).start()
        address = f"https://127.0.0.1:{listening.getsockname()[1]}/v1"
        (error,) = ended(lambda: LiteLLMChat("openai/m", api_base=address, timeout=HANG).send(PLAIN))
    assert isinstance(error, ChatError)
    assert "does not speak TLS" in str(error) and "http or https in the server's address" in str(error)
