"""Messages between this process, the nursery and the workers: small headers over a local stream socket.

Workers run untrusted code, which may write to the socket too. So they reply with numbers and text, never with
pickles, and whatever does not look like a reply ends the connection.
"""

import contextlib
import math
import os
import socket
import struct
import time
from dataclasses import dataclass
from typing import Literal

from falsifier.core import operating_system
from falsifier.core.printable import printable

Status = Literal["ok", "failed", "crashed", "timeout", "unusable"]
# Waking up a process takes about 40 microseconds on either side, which is a lot compared with a simulation
# shorter than this; polling for this long costs other processes little.
QUICK_SECONDS = 500e-6

_STATUSES: tuple[Status, ...] = ("ok", "failed", "crashed", "timeout", "unusable")

_REQUEST = struct.Struct("<BBI")
_REPLY = struct.Struct("<4sBBBdI")
_MARK = b"\xf0fmu"
_MOST_TEXT = 1 << 20
# The rest of a message that has begun to arrive is on its way.
_REST_SECONDS = 2.0
# Requests fit into the socket's buffer unless a worker has stopped reading.
_SENDING_SECONDS = 30.0


@dataclass(frozen=True, slots=True)
class Reply:
    """Outcome of one request.

    Attributes:
        status: how it ended.
        text: the reason, if the status is not ok; otherwise the result, if the request has one.
        time: simulated time reached, in s; -1 if unknown.
        more: whether another reply follows without a request.
        leaving: whether the process ends after this reply.
    """

    status: Status = "ok"
    text: str = ""
    time: float = -1.0
    more: bool = False
    leaving: bool = False


class Closed(Exception):
    """The other end has closed the connection."""


class Garbled(Closed):
    """The other end has sent something that is not a reply, so the connection cannot be used any more."""


def open_channel() -> tuple[socket.socket, socket.socket]:
    """Return both ends of a new connection: for requests, and for replies."""
    ours, theirs = socket.socketpair()
    operating_system.limit_sending(ours, _SENDING_SECONDS)
    return ours, theirs


def send_request(
    sock: socket.socket, kind: int, payload: bytes = b"", descriptors: tuple[int, ...] = ()
) -> None:
    """Send one request with file descriptors.

    Raises:
        Closed: if the other end has closed the connection.
    """
    try:
        sock.sendall(_REQUEST.pack(kind, len(descriptors), len(payload)) + payload)
        if descriptors:
            operating_system.send_descriptors(sock, descriptors)
    except OSError as error:
        raise Closed from error


def receive_request(sock: socket.socket) -> tuple[int, bytes, list[int]]:
    """Wait for one request; return its kind, payload and file descriptors.

    Raises:
        Closed: if the other end has closed the connection.
    """
    try:
        kind, count, length = _REQUEST.unpack(_exactly(sock, _REQUEST.size))
        payload = _exactly(sock, length) if length else b""
        descriptors = operating_system.receive_descriptors(sock, count) if count else []
        return kind, payload, descriptors
    except ConnectionError as error:
        raise Closed from error


def send_reply(sock: socket.socket, reply: Reply) -> None:
    """Send one reply; a reader that has closed the connection is ignored."""
    text = reply.text.encode("utf-8", "replace")[:_MOST_TEXT]
    header = _REPLY.pack(
        _MARK, _STATUSES.index(reply.status), reply.more, reply.leaving, reply.time, len(text)
    )
    with contextlib.suppress(ConnectionError):
        sock.sendall(header + text)


def receive_reply(sock: socket.socket, limit: float, life: int | None = None) -> Reply:
    """Wait for a reply, at most ``limit`` seconds.

    Args:
        sock: connection to the process that replies.
        limit: number of seconds.
        life: see ``operating_system.open_life``. What the other process has forked keeps the connection open,
            so its end alone does not say that the process has ended.

    Raises:
        TimeoutError: if there was none.
        Closed: if the other end has closed the connection, or its process has ended.
        Garbled: if what arrived is not a reply.
    """
    try:
        header = _exactly(sock, _REPLY.size, limit, life)
        mark, status, more, leaving, reached, length = _REPLY.unpack(header)
        if mark != _MARK or status >= len(_STATUSES) or more > 1 or leaving > 1 or length > _MOST_TEXT:
            raise Garbled
        try:
            text = _exactly(sock, length, _REST_SECONDS).decode("utf-8", "replace") if length else ""
        except TimeoutError:
            raise Garbled from None
    except ConnectionError as error:
        raise Closed from error
    reached = reached if math.isfinite(reached) else -1.0
    return Reply(_STATUSES[status], printable(text), reached, bool(more), bool(leaving))


def watch(sock: socket.socket, seconds: float) -> None:
    """Poll for the next message for at most this long, yielding the processor to other processes."""
    until = time.perf_counter() + seconds
    while time.perf_counter() < until:
        try:
            operating_system.receive_now(sock, 1, keep=True)
        except BlockingIOError:
            operating_system.yield_processor()
        except OSError:
            return  # the next receive reports the error
        else:
            return


def close_all(descriptors: list[int]) -> None:
    """Close the file descriptors received with a request."""
    for descriptor in descriptors:
        with contextlib.suppress(OSError):
            os.close(descriptor)


def _exactly(sock: socket.socket, count: int, limit: float | None = None, life: int | None = None) -> bytes:
    """Receive this many bytes.

    Args:
        sock: where from.
        count: how many, at least one.
        limit: maximum number of seconds to wait for the first byte; None: no limit.
        life: ends the wait for the first byte when it becomes readable.

    Raises:
        TimeoutError: if nothing arrives in time.
        Garbled: if something arrives in time, but the rest does not follow.
        Closed: if the other end closes the connection before.
    """
    data = _received(sock, count, limit, life)
    until = time.perf_counter() + _REST_SECONDS
    while len(data) < count:
        left = until - time.perf_counter() if limit is not None else None
        if left is not None and left <= 0:
            raise Garbled
        try:
            data += _received(sock, count - len(data), left)
        except TimeoutError:
            raise Garbled from None
    return data


def _received(sock: socket.socket, count: int, limit: float | None, life: int | None = None) -> bytes:
    if limit is not None:
        with contextlib.suppress(BlockingIOError):
            return _some(operating_system.receive_now(sock, count))
        if not operating_system.wait_readable(sock, life, max(0.0, limit)):
            raise Closed
    return _some(sock.recv(count))


def _some(data: bytes) -> bytes:
    if not data:
        raise Closed
    return data
