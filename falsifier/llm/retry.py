"""Retries of requests that failed for a temporary reason."""

import logging
import random
from collections.abc import Callable
from time import sleep

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


def retried(
    ask: Callable[[], ChatReply],
    *,
    attempts: int = DEFAULT_ATTEMPTS,
    first_delay: float = FIRST_DELAY,
    seconds_left: Callable[[], float | None] = lambda: None,
) -> ChatReply:
    """Ask, and ask again after rate limits, timeouts, lost connections and server errors.

    Args:
        ask: sends the question.
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
                sleep(delay)
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
