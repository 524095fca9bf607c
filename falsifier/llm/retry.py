"""Retries of requests that failed for a temporary reason, coordinated between runs."""

import logging
import random
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from falsifier.core.words import counted
from falsifier.errors import ChatError
from falsifier.llm.failures import TransientChatError
from falsifier.llm.messages import Chat, ChatReply, ChatRequest, Usage

_LOG = logging.getLogger(__name__)

# With doubling delays the last request is sent about a minute after the first: enough for a server restart.
DEFAULT_ATTEMPTS = 7


class Gate:
    """Limits concurrent requests and makes all of them wait during a pause.

    Runs that share a gate share the provider's rate limit: if one is told to wait, all wait.
    """

    def __init__(self, concurrency: int = 4, *, sleep: Callable[[float], None] = time.sleep) -> None:
        self._slots = threading.BoundedSemaphore(concurrency)
        self._lock = threading.Lock()
        self._open_at = 0.0
        self._sleep = sleep

    @contextmanager
    def passage(self, limit: float | None = None) -> Iterator[None]:
        """Wait for a slot and for the end of a pause, at most ``limit`` seconds.

        Raises:
            ChatError: if that is too short.
        """
        limit = None if limit is None else min(limit, threading.TIMEOUT_MAX)
        until = None if limit is None else time.monotonic() + limit
        if not self._slots.acquire(timeout=limit):
            raise ChatError("no time is left: other requests to this language model are still waiting")
        try:
            while (wait := self.remaining()) > 0:
                if until is not None and time.monotonic() + wait > until:
                    raise ChatError(
                        f"no time is left: requests to this language model pause for another {wait:.0f} s"
                    )
                self._sleep(wait)
            yield
        finally:
            self._slots.release()

    def pause(self, seconds: float) -> None:
        """Hold back all requests for this many seconds from now."""
        with self._lock:
            self._open_at = max(self._open_at, time.monotonic() + seconds)

    def wait(self, seconds: float) -> None:
        """Wait without delaying other requests."""
        self._sleep(seconds)

    def remaining(self) -> float:
        """Seconds until the end of a pause; negative after it."""
        with self._lock:
            return self._open_at - time.monotonic()


@dataclass(frozen=True)
class RetryingChat:
    """Retries after rate limits, timeouts, lost connections and server errors.

    Attributes:
        inner: chat to ask.
        gate: shared between all runs that use the same account.
        attempts: maximum number of requests per reply.
        first_delay: seconds before the second request; each further delay is twice as long, with jitter.
        longest_delay: maximum number of seconds between two requests; if the server asks for more, the
            request fails.
    """

    inner: Chat
    gate: Gate = field(default_factory=Gate)
    attempts: int = DEFAULT_ATTEMPTS
    first_delay: float = 1.0
    longest_delay: float = 120.0

    @property
    def llm(self) -> str:
        return self.inner.llm

    @property
    def parameters(self) -> Mapping[str, Any]:
        return self.inner.parameters

    def complete(self, request: ChatRequest) -> ChatReply:
        """Ask, and ask again after temporary failures.

        Raises:
            ChatError: if the last attempt failed, there is no time for another one, or for a failure that
                waiting does not cure.
        """
        lost: list[Usage] = []
        try:
            reply = self._complete(request, lost)
        except ChatError as error:
            error.lost = sum(lost[1:], lost[0]) if lost else error.lost
            raise
        return reply.model_copy(update={"usage": sum(lost, reply.usage)}) if lost else reply

    def _complete(self, request: ChatRequest, lost: list[Usage]) -> ChatReply:
        for attempt in range(1, self.attempts + 1):
            try:
                with self.gate.passage(request.seconds_left):
                    reply = self.inner.complete(request)
                return reply.model_copy(update={"attempts": attempt})
            except TransientChatError as error:
                lost += [error.lost] if error.lost else []
                asked = error.retry_after
                if asked is not None and asked > self.longest_delay:
                    raise ChatError(
                        f"the server asks to wait {asked:g} s; try again later. {error}"
                    ) from None
                limit = min(self.attempts, error.patience or self.attempts)
                if attempt >= limit:
                    raise ChatError(
                        f"{counted(attempt, 'attempt')} failed, the last one so: {error}"
                    ) from None
                own = self.first_delay * 2 ** (attempt - 1) * random.uniform(0.75, 1.25)
                delay = min(own, self.longest_delay) if asked is None else asked
                left = request.seconds_left
                if left is not None and delay >= left:
                    raise ChatError(f"no time is left to ask again. {error}") from None
                _LOG.warning("%s. Retrying in %.0f s (attempt %d of %d).", error, delay, attempt + 1, limit)
                (self.gate.pause if error.for_all else self.gate.wait)(delay)
        raise AssertionError("attempts is at least 1")

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        self.inner.accepted(request, reply)
