"""Retries of requests that failed for a temporary reason, coordinated between runs."""

import logging
import random
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from falsifier.core.words import counted
from falsifier.errors import ChatError
from falsifier.llm.failures import TransientChatError
from falsifier.llm.messages import ChatReply, Usage

_LOG = logging.getLogger(__name__)

# With doubling delays the last request is sent about a minute after the first: enough for a server restart.
DEFAULT_ATTEMPTS = 7
FIRST_DELAY = 1.0
# If the server asks for a longer wait, the request fails; in s.
_LONGEST_DELAY = 120.0


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


def retried(
    ask: Callable[[], ChatReply],
    gate: Gate,
    *,
    attempts: int = DEFAULT_ATTEMPTS,
    first_delay: float = FIRST_DELAY,
    seconds_left: Callable[[], float | None] = lambda: None,
) -> ChatReply:
    """Ask, and ask again after rate limits, timeouts, lost connections and server errors.

    Args:
        ask: sends the question.
        gate: shared between all runs that use the same account.
        attempts: maximum number of requests.
        first_delay: seconds before the second request; each further delay is twice as long, with jitter.
        seconds_left: seconds until the answer is of no use any more; None: it always is.

    Raises:
        ChatError: if the last attempt failed, there is no time for another one, or for a failure that waiting
            does not cure. Its ``lost`` says what was paid for nothing.
    """
    lost: list[Usage] = []
    try:
        for attempt in range(1, attempts + 1):
            try:
                with gate.passage(seconds_left()):
                    reply = ask()
            except TransientChatError as error:
                lost += [error.lost] if error.lost else []
                limit = min(attempts, error.patience or attempts)
                if attempt >= limit:
                    raise ChatError(
                        f"{counted(attempt, 'attempt')} failed, the last one so: {error}"
                    ) from None
                delay = _delay(error, first_delay * 2 ** (attempt - 1))
                left = seconds_left()
                if left is not None and delay >= left:
                    raise ChatError(f"no time is left to ask again. {error}") from None
                _LOG.warning("%s. Retrying in %.0f s (attempt %d of %d).", error, delay, attempt + 1, limit)
                (gate.pause if error.for_all else gate.wait)(delay)
            else:
                return reply.model_copy(update={"attempts": attempt, "usage": sum(lost, reply.usage)})
    except ChatError as error:
        error.lost = sum(lost[1:], lost[0]) if lost else error.lost
        raise
    raise AssertionError("attempts is at least 1")


def _delay(error: TransientChatError, usual: float) -> float:
    """Seconds before the next request: as the server asks, else the usual ones with jitter.

    Raises:
        ChatError: if the server asks for more than is worth waiting for.
    """
    if error.retry_after is None:
        return min(usual * random.uniform(0.75, 1.25), _LONGEST_DELAY)
    if error.retry_after > _LONGEST_DELAY:
        wait = f"{error.retry_after:g} s"
        raise ChatError(f"the server asks to wait {wait}; try again later. {error}") from None
    return error.retry_after
