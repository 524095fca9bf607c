"""One call to a server: it ends in time, and what it sends and receives is limited.

A client library's timeout starts again with every byte that arrives, so a server that sends one byte a second
is never too late for it. Here the call runs in a thread of its own, is waited for only so long, and its
connections are cut when it is given up, in whatever state they are.

The client library makes its HTTP clients of what ``guarded_client`` returns; requests of those that are not
made within ``within`` are sent as httpx would.
"""

import atexit
import os
import socket
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar, copy_context
from http.cookiejar import CookieJar, DefaultCookiePolicy
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from types import MappingProxyType
from typing import Any, TypeVar, cast
from weakref import WeakSet

import httpx

from falsifier.errors import setting
from falsifier.llm.reply_bodies import (
    ADDRESS,
    NO_LLM,
    BrokenReplyError,
    UnusableReplyError,
    mended,
    unreadable,
    with_error_apart,
)

T = TypeVar("T")

# A reply of a million characters (messages.LONGEST_REPLY), each escaped, twice over.
_MOST_BYTES = 16 << 20
# Of an error no more is read: client libraries search it with patterns, which takes seconds per megabyte.
_MOST_OF_ERROR = 64 << 10
# Time for a call that was given up, and whose connections are cut, to end, in s.
_GRACE = 0.5
_GIVEN_UP: WeakSet[Thread] = WeakSet()
_REDIRECTS = frozenset({301, 302, 303, 307, 308})
_TOO_LONG = f"the reply has more than {_MOST_BYTES >> 20} MiB"

# Malformed replies to a question after which no other is to be expected; each takes time and tokens.
_MOST_MALFORMED = 3
_WITHIN = "the connection was cut within the reply"
_CUT = "the server or a proxy before it ended it; its log says why"
# How httpx and what it stands on tell a failure, by words of it, and what causes and cures it.
_FAULTS = (
    (
        ("name or service not known", "name resolution", "getaddrinfo", "nodename nor servname"),
        "the server's name is not known here",
        "check the server's address and the network",
    ),
    (
        ("certificate_verify_failed",),
        "the server's certificate is not trusted",
        "name the file with its authority's certificate in the environment variable SSL_CERT_FILE",
    ),
    (("[ssl",), "the server does not speak TLS", ADDRESS),
    (
        ("without sending a response",),
        "the server closed the connection without a reply",
        f"{ADDRESS}, and the server's log",
    ),
    (("receive buffer too long",), "the reply has headers of more than 100 kB", NO_LLM),
    (("illegal chunk", "transfer-encoding"), "the reply is no valid HTTP", _CUT),
    (("illegal", "protocol"), "the server does not answer in HTTP", NO_LLM),
    (("without sending complete", "incomplete"), _WITHIN, _CUT),
    (("reset by peer", "broken pipe"), "the connection was cut", _CUT),
)


class RefusedReplyError(Exception):
    """The server did something that is not accepted; the message says what."""


def within(
    seconds: float,
    action: Callable[[], T],
    *,
    never: Collection[str] = (),
    withheld: Mapping[str, str] = MappingProxyType({}),
    dropped: Collection[tuple[str, str]] = (),
) -> T:
    """Return what an action returns, or give it up after so many seconds and cut its connections.

    Nothing is sent to the hosts ``never``, and no key that is ``withheld``: each with whose it is, and what
    to do. Headers that are ``dropped``, by name and value, are left out.

    Raises:
        TimeoutError: if it has not returned by then.
        RefusedReplyError: if a server's reply was refused.
        BrokenReplyError: if the action failed because of the connection, or of a reply that is not readable.
    """
    call = _Call(never, withheld, dropped)
    outcome: SimpleQueue[tuple[T | None, BaseException | None]] = SimpleQueue()

    def work() -> None:
        _CALL.set(call)
        try:
            outcome.put((action(), None))
        except BaseException as error:
            outcome.put((None, error))

    thread = Thread(target=copy_context().run, args=(work,), daemon=True, name="request")
    thread.start()
    is_over = False
    try:
        result, error = outcome.get(timeout=seconds)
        is_over = True
    except Empty:
        raise TimeoutError(f"no complete reply within {seconds:.3g} s") from None
    finally:
        # Also after Ctrl-C: otherwise the thread would wait for the server as long as that likes.
        call.end()
        if not is_over:
            _GIVEN_UP.add(thread)
    if call.refusal:
        raise RefusedReplyError(call.refusal)
    if error is not None and call.fault:
        raise call.fault from error
    if error is not None:
        raise error
    return result  # type: ignore[return-value]


@atexit.register
def _wait_for_imports() -> None:
    """Let calls that were given up end what they import, before the process ends.

    Client libraries import at their first call. A thread that is stopped within an import keeps its lock, and
    what is destroyed at the end of the process then waits for that lock for ever.
    """
    with suppress(KeyboardInterrupt):
        for thread in list(_GIVEN_UP):
            thread.join(_GRACE)
            while _is_importing(thread):
                thread.join(_GRACE)


def _is_importing(thread: Thread) -> bool:
    frame = sys._current_frames().get(thread.ident or 0)
    while frame is not None and "importlib._bootstrap" not in frame.f_code.co_filename:
        frame = frame.f_back
    return frame is not None


class _Call:
    """The connections of one call, why a reply was refused, and what was wrong with the last one."""

    def __init__(
        self, never: Collection[str], withheld: Mapping[str, str], dropped: Collection[tuple[str, str]]
    ) -> None:
        self.never, self.withheld, self.dropped = never, withheld, dropped
        self.refusal = ""
        self.fault: BrokenReplyError | None = None
        self._lock = Lock()
        self._connections: list[socket.socket] = []
        self.has_ended = False

    def end(self) -> None:
        """Cut all connections; no others can be made."""
        with self._lock:
            self.has_ended = True
            for connection in self._connections:
                _cut(connection)
            self._connections.clear()

    def refuse(self, reason: str) -> None:
        """End the request because of this, with an httpx.TransportError."""
        self.refusal = self.refusal or reason
        raise httpx.TransportError(reason)

    def note(self, event: str, info: Mapping[str, Any]) -> None:
        """Take note of a new connection; called by the transport."""
        if not event.endswith(("connect_tcp.complete", "connect_unix_socket.complete")):
            return
        original = info["return_value"].get_extra_info("socket")
        # A duplicate stays valid when TLS takes over the original.
        connection = socket.socket(fileno=os.dup(original.fileno()))
        with self._lock:
            if not self.has_ended:
                self._connections.append(connection)
                return
        _cut(connection)

    @contextmanager
    def noting_faults(self) -> Iterator[None]:
        try:
            yield
        except httpx.TimeoutException:
            raise
        except httpx.TransportError as error:
            text = self.refusal or _fault_of(error)
            kind = UnusableReplyError if text.startswith(_WITHIN) else BrokenReplyError
            self.fault = kind(text)
            raise


def _cut(connection: socket.socket) -> None:
    with suppress(OSError):  # it may have ended already
        connection.shutdown(socket.SHUT_RDWR)
    connection.close()


_CALL: ContextVar[_Call | None] = ContextVar("_CALL", default=None)


class _Guarded(httpx.BaseTransport):
    """Sends each request of a call on a connection of its own, and checks the response."""

    def __init__(self, plain: httpx.Client) -> None:
        self._plain = plain

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        call = _CALL.get()
        if call is None:
            return self._plain.send(request, stream=True)
        if call.has_ended:  # litellm looks up prices and the like in threads that outlive the call
            raise httpx.TransportError("the call has ended")
        if request.url.host in call.never:
            own = f"the address of your server: {setting('api_base', 'URL')}"
            call.refuse(f"nothing was sent: it would have gone to {request.url.host}; state {own}")
        for name, value in call.dropped:
            if value in map(str.strip, request.headers.get_list(name)):
                del request.headers[name]
        for value in request.headers.values():
            if value and (advice := call.withheld.get(value.removeprefix("Bearer ").strip())):
                call.refuse(f"nothing was sent to {request.url.host}: it would have got {advice}")
        # A connection kept from an earlier call would be unknown here and could not be cut.
        request.headers["Connection"] = "close"
        # Compressed, a small reply could fill the memory.
        request.headers["Accept-Encoding"] = "identity"
        request.extensions = {**request.extensions, "trace": call.note}
        call.fault = None
        with call.noting_faults():
            response = self._plain.send(request, stream=True)
        encoding = response.headers.get("content-encoding", "identity").lower()
        length = response.headers.get("content-length", "")
        if response.status_code in _REDIRECTS:
            call.refuse(_redirection(request.url, response.headers.get("location")))
        if encoding != "identity":
            call.refuse(f"the reply is compressed ({encoding[:20]}), which was not asked for")
        if length.isascii() and length.isdigit() and float(length) > _MOST_BYTES:
            call.refuse(_TOO_LONG)
        stream = cast(httpx.SyncByteStream, response.stream)
        response.stream = _Limited(call, stream, is_success=response.is_success)
        return response

    def close(self) -> None:
        self._plain.close()


class _Limited(httpx.SyncByteStream):
    """A response's stream, which ends at the limit, and says if what came is no reply."""

    def __init__(self, call: _Call, inner: httpx.SyncByteStream, *, is_success: bool) -> None:
        self._call, self._inner, self._is_success = call, inner, is_success

    def __iter__(self) -> Iterator[bytes]:
        received, most = bytearray(), _MOST_BYTES if self._is_success else _MOST_OF_ERROR
        with self._call.noting_faults():
            for part in self._inner:
                received += part
                if len(received) > most:
                    break
            if self._is_success and len(received) > most:
                self._call.refuse(_TOO_LONG)
        body = bytes(received[:most])
        if self._is_success:
            body = with_error_apart(body)
            fault = self._call.fault = unreadable(body)
            fault.patience = _MOST_MALFORMED if fault.status_code is None else None
        yield mended(body) if isinstance(self._call.fault, UnusableReplyError) else body

    def close(self) -> None:
        self._inner.close()


def _redirection(asked: httpx.URL, location: str | None) -> str:
    """Why a redirect is refused: a prompt goes only where the user sent it."""
    try:
        target = asked.join(location or "").copy_with(query=None, fragment=None)
    except (httpx.InvalidURL, ValueError):
        return "the server redirects to an address that cannot be read, and prompts do not follow"
    if target == asked:
        return "the server redirects to the same address, or names none; check its address and its log"
    base = str(target).removesuffix("/chat/completions").removesuffix("/api/chat")[:200]
    stated = setting("api_base", base)
    return (
        f"the server redirects to {base}, and prompts do not follow; if that is the right address: {stated}"
    )


def _fault_of(error: Exception) -> str:
    """What is wrong with a connection, and what to do."""
    text = str(error).partition(": bytearray(")[0].rstrip(".") or type(error).__name__
    if isinstance(error, httpx.ProxyError):
        return f"the proxy does not pass the request on ({text}): check HTTP_PROXY, HTTPS_PROXY and NO_PROXY"
    for words, cause, cure in _FAULTS:
        if any(word in text.lower() for word in words):
            return f"{cause} ({text}): {cure}"
    return f"no connection to the server ({text}): check the server's address and the network"


def guarded_client(*, verify: Any = True) -> httpx.Client:
    """Return an HTTP client whose requests are limited within ``within``; it follows no redirect."""
    # A server's cookies would be sent to it with later requests, of other runs too.
    none = CookieJar(policy=DefaultCookiePolicy(allowed_domains=()))
    # It finds the proxies of the environment, which a client with a transport of its own does not look for.
    plain = httpx.Client(verify=verify, timeout=None, cookies=none)
    return httpx.Client(transport=_Guarded(plain), cookies=none)
