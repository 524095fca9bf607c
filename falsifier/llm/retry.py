"""Patience: requests that failed for a passing reason are sent again, by all runs together."""

import logging
import random
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from falsifier.errors import ChatError
from falsifier.llm.failures import TransientChatError
from falsifier.llm.messages import Chat, ChatReply, ChatRequest

_LOG = logging.getLogger(__name__)

# With doubling delays the last request goes out about a minute after the first, so that a server may restart.
DEFAULT_ATTEMPTS = 7


class Gate:
    """How many requests may be under way at a time, and until when all of them wait.

    Runs that share a gate share the provider's rate limit: when one is told to wait, all wait.
    """

    def __init__(self, concurrency: int = 4, *, sleep: Callable[[float], None] = time.sleep) -> None:
        self._slots = threading.BoundedSemaphore(concurrency)
        self._lock = threading.Lock()
        self._open_at = 0.0
        self._sleep = sleep

    @contextmanager
    def passage(self) -> Iterator[None]:
        """Wait for a slot and for the end of a pause."""
        with self._slots:
            while (wait := self.remaining()) > 0:
                self._sleep(wait)
            yield

    def pause(self, seconds: float) -> None:
        """Let nobody through for this many seconds from now."""
        with self._lock:
            self._open_at = max(self._open_at, time.monotonic() + seconds)

    def wait(self, seconds: float) -> None:
        """Wait without holding up others."""
        self._sleep(seconds)

    def remaining(self) -> float:
        """Seconds until the end of a pause; negative after it."""
        with self._lock:
            return self._open_at - time.monotonic()


@dataclass(frozen=True)
class RetryingChat:
    """Sends again after rate limits, timeouts, lost connections and server errors.

    Attributes:
        inner: what is asked.
        gate: shared between all runs that use the same account.
        attempts: most requests for one answer.
        first_delay: seconds before the second request; each further delay is twice as long, with jitter.
        longest_delay: most seconds between two requests; a server that asks for more ends the run.
    """

    inner: Chat
    gate: Gate = field(default_factory=Gate)
    attempts: int = DEFAULT_ATTEMPTS
    first_delay: float = 1.0
    longest_delay: float = 120.0

    @property
    def llm(self) -> str:
        """See Chat."""
        return self.inner.llm

    @property
    def parameters(self) -> Mapping[str, Any]:
        """See Chat."""
        return self.inner.parameters

    def complete(self, request: ChatRequest) -> ChatReply:
        """Answer, with patience.

        Raises:
            ChatError: when the last attempt failed, or for a failure that waiting does not cure.
        """
        for attempt in range(1, self.attempts + 1):
            try:
                with self.gate.passage():
                    reply = self.inner.complete(request)
                return reply.model_copy(update={"attempts": attempt})
            except TransientChatError as error:
                asked = error.retry_after
                if asked is not None and asked > self.longest_delay:
                    raise ChatError(
                        f"{error} The server asks to wait {asked:g} s; try again later."
                    ) from None
                most = min(self.attempts, error.patience or self.attempts)
                if attempt >= most:
                    raise ChatError(f"gave up after {attempt} attempts. {error}") from None
                own = self.first_delay * 2 ** (attempt - 1) * random.uniform(0.75, 1.25)
                delay = min(own, self.longest_delay) if asked is None else asked
                _LOG.warning("%s. Asking again in %.0f s (%d of %d).", error, delay, attempt + 1, most)
                (self.gate.pause if error.for_all else self.gate.wait)(delay)
        raise AssertionError("attempts is at least 1")

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """See Chat."""
        self.inner.accepted(request, reply)
