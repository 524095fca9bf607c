"""Requests to a worker, and its replies.

The worker runs an untrusted FMU, which may write to the same place. Its replies are numbers and text;
whatever does not look like one ends the connection.
"""

import math
import struct
import time
from dataclasses import dataclass
from enum import IntEnum

from falsifier.core import posix
from falsifier.core.literals import printable

# Waking up a process takes about 40 microseconds on either side, which is a lot compared with a simulation
# shorter than this; polling for this long costs other processes little.
QUICK_SECONDS = 500e-6

_REQUEST = struct.Struct("<II")
_REPLY = struct.Struct("<IIIIIId")
_MARK = 0x756D66F0
_MORE, _LEAVING = 1, 2
_MOST_TEXT = 1 << 16
# The rest of a message that has begun to arrive is on its way.
_REST_SECONDS = 2.0
# Requests fit into the pipe's buffer unless a worker has stopped reading.
_SENDING_SECONDS = 30.0


class Request(IntEnum):
    """What a worker is asked, as in main.c."""

    CONNECT = 0
    LOAD = 1
    PREPARE = 2
    SIMULATE = 3


class Where(IntEnum):
    """Where a simulation stopped: ``enum where`` in worker.h."""

    DONE = 0
    SETTING = 1
    STEPPING = 2
    GETTING = 3
    EVENT = 4
    TERMINATED = 5
    STUCK = 6
    TOO_SMALL = 7
    NOT_CONVERGED = 9
    RESTORING = 10
    NOT_A_NUMBER = 11
    UNSETTLED = 12
    MISSING_AT_FIRST = 13
    MISSING_AFTER_START = 14
    CALLING = 20
    WRITING = 21
    TEXT = 22
    TIMEOUT = 23
    IMPOSSIBLE = 24
    CANNOT_RENEW = 25
    CRASHED = 26


@dataclass(frozen=True, slots=True)
class Reply:
    """Outcome of one request."""

    where: int  # where it stopped; ``Where``, or any other number
    status: int = 0  # FMI's status
    text: str = ""  # what the outcome needs to be told
    time: float = -1.0  # simulated time in s; -1 if unknown
    printed: int = 0  # position in its output at which the reply was sent
    more: bool = False  # whether another reply follows without a request
    leaving: bool = False  # whether the process ends after this reply
    component: int = -1  # position of the component of a system that has failed; -1 if unknown

    @property
    def is_done(self) -> bool:
        """Whether the request was carried out."""
        return self.where == Where.DONE


class Garbled(ConnectionError):
    """What has arrived is not a reply, so the connection cannot be used any more."""


def send(program: posix.WatchedProgram, kind: Request, payload: bytes = b"") -> None:
    """Send one request; ConnectionError if the program has ended, or does not read it."""
    program.send(_REQUEST.pack(kind, len(payload)) + payload, _SENDING_SECONDS)


def receive(program: posix.WatchedProgram, limit: float, *, polling: float = 0.0) -> Reply:
    """Wait for a reply, at most this many seconds; at first poll, yielding to other processes.

    Raises:
        TimeoutError: if there was none.
        ConnectionError: if the program has ended or closed its end; Garbled if what arrived is not a reply.
    """
    mark, where, status, flags, length, printed, reached = _REPLY.unpack(
        _exactly(program, _REPLY.size, limit, polling)
    )
    if mark != _MARK or flags > _MORE | _LEAVING or length > _MOST_TEXT:
        raise Garbled
    try:
        text = _exactly(program, length, _REST_SECONDS).decode("utf-8", "replace") if length else ""
    except TimeoutError:
        raise Garbled from None
    reached = reached if math.isfinite(reached) else -1.0
    more, leaving = bool(flags & _MORE), bool(flags & _LEAVING)
    return Reply(where, status, printable(text), reached, printed, more, leaving)


def _exactly(program: posix.WatchedProgram, count: int, limit: float, polling: float = 0.0) -> bytes:
    """Receive this many bytes, at least one; the limit in s is for the first of them."""
    data = program.read(count, limit, polling)
    until = time.perf_counter() + _REST_SECONDS
    while data and len(data) < count:
        if time.perf_counter() > until:
            raise Garbled
        try:
            more = program.read(count - len(data), until - time.perf_counter())
        except TimeoutError:
            raise Garbled from None
        data = data + more if more else b""
    if not data:
        raise ConnectionError("the program has ended, or closed its end")
    return data
