"""A language model is asked only while the run's budget lasts."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import monotonic
from typing import Any

from falsifier.errors import ChatError
from falsifier.llm.messages import Chat, ChatReply, ChatRequest
from falsifier.search.budget import Budget, LimitReached, Spent

# A wait for a reply may end this much before the time that it was given.
_CLOCK_TOLERANCE = 0.05


@dataclass(frozen=True, slots=True)
class BoundedChat:
    """Checks the budget before every request, whether it opens a turn, asks again or follows a tool call.

    Attributes:
        inner: chat to ask.
        budget: limits of the run.
        spent: returns what the run has spent so far.
    """

    inner: Chat
    budget: Budget
    spent: Callable[[], Spent]

    @property
    def llm(self) -> str:
        """Name of the inner chat's LLM."""
        return self.inner.llm

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Parameters of the inner chat."""
        return self.inner.parameters

    def complete(self, request: ChatRequest) -> ChatReply:
        """Ask, with the seconds that are left as a deadline.

        Raises:
            LimitReached: if a limit is reached, before the request or while waiting for the reply.
            ChatError: if no reply can be obtained.
        """
        self._check()
        left = self.budget.seconds_left(self.spent())
        if left is not None:
            request = request.model_copy(update={"deadline": monotonic() + left})
        try:
            return self.inner.complete(request)
        except ChatError as error:
            self._check(ahead=_CLOCK_TOLERANCE, cause=error)
            raise

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Tell the inner chat."""
        self.inner.accepted(request, reply)

    def _check(self, *, ahead: float = 0.0, cause: ChatError | None = None) -> None:
        spent = self.spent()
        if limit := self.budget.exceeded(replace(spent, seconds=spent.seconds + ahead)):
            raise LimitReached(limit) from cause
