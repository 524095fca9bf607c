"""One call to a server: it ends in time, and what it sends and receives is limited.

A client library's timeout starts again with every byte that arrives, so a server that sends one byte a second
is never too late for it. Here the call runs in a thread of its own, is waited for only so long, and its
connections are cut when it is given up, in whatever state they are.

litellm makes its HTTP clients in many places. What they share is httpx's transport, whose one method is
therefore replaced; requests that are not made within ``within`` pass through it unchanged.
"""

import atexit
import os
import socket
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from contextvars import ContextVar, copy_context
from functools import cache
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakSet

if TYPE_CHECKING:
    import httpx

T = TypeVar("T")

# A reply of a million characters (incoming.LONGEST_REPLY), each escaped, twice over.
_MOST_BYTES = 16 << 20
# Time for a call that was given up, and whose connections are cut, to end, in s.
_GRACE = 0.5
_GIVEN_UP: WeakSet[Thread] = WeakSet()
_REDIRECTS = frozenset({301, 302, 303, 307, 308})


class RefusedReplyError(Exception):
    """The server did something that is not accepted; the message says what."""


def within(seconds: float, action: Callable[[], T]) -> T:
    """Return what an action returns, or give it up after so many seconds and cut its connections.

    Raises:
        TimeoutError: if it has not returned by then.
        RefusedReplyError: if a server's reply was refused.
    """
    _guard_transport()
    call = _Call()
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
    """The connections of one call, and why a reply was refused."""

    def __init__(self) -> None:
        self.refusal = ""
        self._lock = Lock()
        self._connections: list[socket.socket] = []
        self._has_ended = False

    def end(self) -> None:
        """Cut all connections; no others can be made."""
        with self._lock:
            self._has_ended = True
            for connection in self._connections:
                with suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)
                connection.close()
            self._connections.clear()

    def send(
        self,
        handle: Callable[[Any, "httpx.Request"], "httpx.Response"],
        transport: Any,
        request: "httpx.Request",
    ) -> "httpx.Response":
        """Send a request as the transport would, on a connection of its own, and check the response."""
        import httpx

        if self._has_ended:  # litellm looks up prices and the like in threads that outlive the call
            raise httpx.TransportError("the call has ended")
        # A connection kept from an earlier call would be unknown here and could not be cut.
        request.headers["Connection"] = "close"
        # Compressed, a small reply could fill the memory.
        request.headers["Accept-Encoding"] = "identity"
        request.extensions = {**request.extensions, "trace": self._note}
        response = handle(transport, request)
        self._check(request, response)
        response.stream = _limited_stream(response.stream, self)
        return response

    def refuse(self, reason: str) -> None:
        """End the request because of this.

        Raises:
            httpx.TransportError: always.
        """
        import httpx

        self.refusal = self.refusal or reason
        raise httpx.TransportError(reason)

    def _note(self, event: str, info: Mapping[str, Any]) -> None:
        """Take note of a new connection; called by the transport."""
        if not event.endswith(("connect_tcp.complete", "connect_unix_socket.complete")):
            return
        original = info["return_value"].get_extra_info("socket")
        # A duplicate stays valid when TLS takes over the original.
        connection = socket.socket(fileno=os.dup(original.fileno()))
        with self._lock:
            if not self._has_ended:
                self._connections.append(connection)
                return
        connection.shutdown(socket.SHUT_RDWR)
        connection.close()

    def _check(self, request: "httpx.Request", response: "httpx.Response") -> None:
        if response.status_code in _REDIRECTS and (target := response.headers.get("location")):
            self._check_redirect(request.url, target)
        encoding = response.headers.get("content-encoding", "identity").lower()
        if encoding != "identity":
            self.refuse(f"the reply is compressed ({encoding[:20]}), which was not asked for")
        length = response.headers.get("content-length", "")
        if length.isascii() and length.isdigit() and float(length) > _MOST_BYTES:
            self.refuse(_too_long())

    def _check_redirect(self, asked: "httpx.URL", location: str) -> None:
        import httpx

        try:
            target = asked.join(location)
        except (httpx.InvalidURL, ValueError):
            self.refuse("the server redirects to an address that cannot be read")
        is_safer = (asked.scheme, target.scheme) == ("http", "https")
        is_same = (asked.scheme, asked.port) == (target.scheme, target.port)
        if target.host != asked.host or not (is_same or is_safer):
            origin = f"{target.scheme}://{target.netloc.decode('ascii', 'replace')}"[:200]
            self.refuse(
                f"the server redirects to {origin}, and prompts do not follow; if that is the right address, "
                "state it with --api-base"
            )


_CALL: ContextVar[_Call | None] = ContextVar("_CALL", default=None)


@cache
def _guard_transport() -> None:
    import httpx

    handle = httpx.HTTPTransport.handle_request

    def handle_request(self: httpx.HTTPTransport, request: httpx.Request) -> httpx.Response:
        call = _CALL.get()
        return handle(self, request) if call is None else call.send(handle, self, request)

    httpx.HTTPTransport.handle_request = handle_request  # type: ignore[method-assign]


def _limited_stream(inner: Any, call: _Call) -> Any:
    import httpx

    class Limited(httpx.SyncByteStream):
        def __iter__(self) -> Iterator[bytes]:
            received = 0
            for part in inner:
                received += len(part)
                if received > _MOST_BYTES:
                    call.refuse(_too_long())
                yield part

        def close(self) -> None:
            inner.close()

    return Limited()


def _too_long() -> str:
    return f"the reply has more than {_MOST_BYTES >> 20} MiB"
