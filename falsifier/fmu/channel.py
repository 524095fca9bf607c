"""Messages between this process, the nursery and the workers: small headers over a local stream socket.

Workers run untrusted code, so they reply with numbers and text, never with pickles.
"""

import contextlib
import os
import socket
import struct
import time
from dataclasses import dataclass
from typing import Literal

Status = Literal["ok", "failed", "crashed", "timeout", "unusable"]
# Waking up a process takes about 40 microseconds on either side, which is a lot compared with a simulation
# shorter than this; polling for this long costs other processes little.
QUICK_SECONDS = 500e-6

_STATUSES: tuple[Status, ...] = ("ok", "failed", "crashed", "timeout", "unusable")

_REQUEST = struct.Struct("<BBI")
_REPLY = struct.Struct("<BBBdI")
_TIMEVAL = struct.Struct("@ll")


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
            socket.send_fds(sock, [b"\0"], list(descriptors))
    except OSError as error:
        raise Closed from error


def receive_request(sock: socket.socket) -> tuple[int, bytes, list[int]]:
    """Wait for one request; return its kind, payload and file descriptors.

    Raises:
        Closed: if the other end has closed the connection.
    """
    try:
        kind, count, length = _REQUEST.unpack(_exactly(sock, _REQUEST.size))
        payload = _exactly(sock, length)
        descriptors = socket.recv_fds(sock, 1, count)[1] if count else []
        return kind, payload, descriptors
    except ConnectionError as error:
        raise Closed from error


def send_reply(sock: socket.socket, reply: Reply) -> None:
    """Send one reply; a reader that has closed the connection is ignored."""
    text = reply.text.encode("utf-8", "replace")
    header = _REPLY.pack(_STATUSES.index(reply.status), reply.more, reply.leaving, reply.time, len(text))
    with contextlib.suppress(ConnectionError):
        sock.sendall(header + text)


def receive_reply(sock: socket.socket, limit: float) -> Reply:
    """Wait for one reply, at most ``limit`` seconds.

    Raises:
        TimeoutError: if there was none.
        Closed: if the other end has closed the connection.
    """
    # The kernel's timeout: after Python's settimeout, recv would wait in spite of MSG_DONTWAIT, see watch.
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _time_limit(limit))
    try:
        status, more, leaving, reached, length = _REPLY.unpack(_exactly(sock, _REPLY.size))
        text = _exactly(sock, length).decode("utf-8", "replace") if length else ""
        return Reply(_STATUSES[status], text, reached, bool(more), bool(leaving))
    except BlockingIOError:
        raise TimeoutError from None
    except ConnectionError as error:
        raise Closed from error


def watch(sock: socket.socket, seconds: float) -> None:
    """Poll for the next message for at most this long, yielding the processor to other processes."""
    until = time.perf_counter() + seconds
    while time.perf_counter() < until:
        try:
            sock.recv(1, socket.MSG_DONTWAIT | socket.MSG_PEEK)
        except BlockingIOError:
            os.sched_yield()
        except OSError:
            return  # the next receive reports the error
        else:
            return


def close_all(descriptors: list[int]) -> None:
    """Close the file descriptors received with a request."""
    for descriptor in descriptors:
        with contextlib.suppress(OSError):
            os.close(descriptor)


def _time_limit(seconds: float) -> bytes:
    whole, rest = divmod(seconds, 1.0)
    return _TIMEVAL.pack(int(whole), int(rest * 1e6))


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
