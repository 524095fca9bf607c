"""Servers that misbehave: a listening socket and a function that does with each connection what it likes."""

import json
import socket
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import closing, suppress
from typing import Any

from tests.llm.server import Step, openai

Behaviour = Callable[[socket.socket, bytes, threading.Event], None]

GOOD = '{"rationale": "because", "signals": [{"name": "u", "values": [1, 1, 1, 1]}]}'


class HostileServer:
    """Reads requests and answers each with the next behaviour; the last one is repeated."""

    def __init__(self, behaviours: Iterable[Behaviour]) -> None:
        self._behaviours = list(behaviours)
        self.requests: list[bytes] = []
        self.closed = threading.Event()
        self.gone = threading.Event()
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.port = self._socket.getsockname()[1]
        self.root = f"http://127.0.0.1:{self.port}"
        self.url = f"{self.root}/v1"
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        self.closed.set()
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        with connection:
            request = _read_request(connection)
            if not request:
                return
            self.requests.append(request)
            index = min(len(self.requests), len(self._behaviours)) - 1
            try:
                self._behaviours[index](connection, request, self.closed)
            except OSError:
                self.gone.set()  # the client has cut the connection


def misbehaving(*behaviours: Behaviour) -> closing[HostileServer]:
    return closing(HostileServer(behaviours))


def _read_request(connection: socket.socket) -> bytes:
    data = b""
    while b"\r\n\r\n" not in data:
        part = connection.recv(65536)
        if not part:
            return b""
        data += part
    head, _, body = data.partition(b"\r\n\r\n")
    lengths = [line for line in head.split(b"\r\n") if line.lower().startswith(b"content-length")]
    length = int(lengths[0].split(b":")[1]) if lengths else 0
    while len(body) < length:
        part = connection.recv(65536)
        if not part:
            break
        body += part
    return head + b"\r\n\r\n" + body


def completion(content: str, **usage: Any) -> bytes:
    """Body of an OpenAI-compatible reply."""
    counts = {"prompt_tokens": 100, "completion_tokens": 30, "total_tokens": 130, **usage}
    return json.dumps(openai(Step(content, usage=counts), {"model": "m"})).encode()


def response(body: bytes, *, status: str = "200 OK", headers: str = "") -> bytes:
    """A whole HTTP response."""
    headers = f"content-type: application/json\r\ncontent-length: {len(body)}\r\n{headers}"
    return f"HTTP/1.1 {status}\r\n{headers}\r\n".encode() + body


def sends(data: bytes) -> Behaviour:
    """Send something at once and close the connection."""
    return lambda connection, _request, _closed: connection.sendall(data)


def answers(content: str = GOOD, **usage: Any) -> Behaviour:
    """Answer as servers should."""
    return sends(response(completion(content, **usage)))


def hangs(after: bytes = b"") -> Behaviour:
    """Send the beginning of a response and then nothing."""

    def behave(connection: socket.socket, _request: bytes, closed: threading.Event) -> None:
        connection.sendall(after)
        # Noticed only by reading: a client that has gone sends end of file.
        connection.settimeout(0.05)
        while not closed.is_set():
            try:
                if not connection.recv(1):
                    raise ConnectionResetError
            except TimeoutError:
                continue

    return behave


def trickles(data: bytes, period: float = 0.02) -> Behaviour:
    """Send one byte after another, for ever."""

    def behave(connection: socket.socket, _request: bytes, closed: threading.Event) -> None:
        position = 0
        while not closed.is_set():
            connection.sendall(data[position % len(data) :][:1])
            position += 1
            time.sleep(period)

    return behave


def in_turn(*behaviours: Behaviour) -> Behaviour:
    """One behaviour after another on the same connection."""

    def behave(connection: socket.socket, request: bytes, closed: threading.Event) -> None:
        for each in behaviours:
            each(connection, request, closed)

    return behave
