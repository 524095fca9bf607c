"""Messages between this process, the nursery and the workers: small headers over a local stream socket.

Workers run foreign code, so what they send is numbers and text, never pickles.
"""

import contextlib
import os
import socket
import struct
from dataclasses import dataclass
from typing import Literal

Status = Literal["ok", "failed", "crashed", "timeout", "unusable"]
_STATUSES: tuple[Status, ...] = ("ok", "failed", "crashed", "timeout", "unusable")

_REQUEST = struct.Struct("<BBI")
_REPLY = struct.Struct("<BBBdI")


@dataclass(frozen=True, slots=True)
class Reply:
    """Outcome of one request.

    Attributes:
        status: how it ended.
        text: reason unless the status is ok.
        time: simulated time that was reached in s, -1 where unknown.
        more: another reply follows without a request.
        leaving: the process ends after this reply.
    """

    status: Status = "ok"
    text: str = ""
    time: float = -1.0
    more: bool = False
    leaving: bool = False


class Closed(Exception):
    """The other end is gone."""


def send_request(
    sock: socket.socket, kind: int, payload: bytes = b"", descriptors: tuple[int, ...] = ()
) -> None:
    """Send one request with file descriptors.

    Raises:
        Closed: when the other end is gone.
    """
    try:
        sock.sendall(_REQUEST.pack(kind, len(descriptors), len(payload)) + payload)
        if descriptors:
            socket.send_fds(sock, [b"\0"], list(descriptors))
    except OSError as error:
        if isinstance(error, TimeoutError):
            raise
        raise Closed from error


def receive_request(sock: socket.socket) -> tuple[int, bytes, list[int]]:
    """Wait for one request: kind, payload, file descriptors.

    Raises:
        Closed: when the other end is gone.
    """
    try:
        kind, count, length = _REQUEST.unpack(_exactly(sock, _REQUEST.size))
        payload = _exactly(sock, length)
        descriptors = socket.recv_fds(sock, 1, count)[1] if count else []
        return kind, payload, descriptors
    except ConnectionError as error:
        raise Closed from error


def send_reply(sock: socket.socket, reply: Reply) -> None:
    """Send one reply; a reader that is gone does not matter."""
    text = reply.text.encode("utf-8", "replace")
    header = _REPLY.pack(_STATUSES.index(reply.status), reply.more, reply.leaving, reply.time, len(text))
    with contextlib.suppress(ConnectionError):
        sock.sendall(header + text)


def receive_reply(sock: socket.socket, limit: float | None) -> Reply:
    """Wait for one reply.

    Raises:
        TimeoutError: when nothing came within limit seconds.
        Closed: when the other end is gone.
    """
    if sock.gettimeout() != limit:
        sock.settimeout(limit)
    try:
        status, more, leaving, time, length = _REPLY.unpack(_exactly(sock, _REPLY.size))
        text = _exactly(sock, length).decode("utf-8", "replace") if length else ""
        return Reply(_STATUSES[status], text, time, bool(more), bool(leaving))
    except ConnectionError as error:
        raise Closed from error


def close_all(descriptors: list[int]) -> None:
    """Close file descriptors that came with a request."""
    for descriptor in descriptors:
        with contextlib.suppress(OSError):
            os.close(descriptor)


def _exactly(sock: socket.socket, count: int) -> bytes:
    if not count:
        return b""
    data = sock.recv(count)
    while 0 < len(data) < count:
        part = sock.recv(count - len(data))
        if not part:
            break
        data += part
    if len(data) < count:
        raise Closed
    return data
