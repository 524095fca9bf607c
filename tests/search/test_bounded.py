import pytest

from falsifier.errors import ChatError
from falsifier.llm.messages import ChatReply, ChatRequest, Message
from falsifier.llm.replay import ScriptedChat
from falsifier.search.budget import BoundedChat, Budget, LimitReached, Spent

QUESTION = ChatRequest(messages=(Message(role="user", content="?"),))


class Asked(ScriptedChat):
    """Keeps the deadlines that it is asked with; fails if told so."""

    def __init__(self, *script: str, error: ChatError | None = None) -> None:
        super().__init__(script)
        self.left: list[float | None] = []
        self.error = error

    def complete(self, request: ChatRequest) -> ChatReply:
        self.left.append(request.seconds_left)
        if self.error:
            raise self.error
        return super().complete(request)


def test_a_request_gets_the_seconds_that_are_left() -> None:
    inner = Asked("a", "b")
    chat = BoundedChat(inner, Budget(simulations=9, seconds=100.0), lambda: Spent(seconds=40.0))
    assert chat.complete(QUESTION).text == "a"
    assert inner.left[0] is not None and 0 < inner.left[0] <= 60.0


def test_without_a_limit_on_the_time_there_is_no_deadline() -> None:
    inner = Asked("a")
    BoundedChat(inner, Budget(simulations=9), lambda: Spent(seconds=40.0)).complete(QUESTION)
    assert inner.left == [None]


@pytest.mark.parametrize(
    ("budget", "spent", "limit"),
    [
        (Budget(seconds=10.0), Spent(seconds=10.0), "time limit of 10 s is reached"),
        (Budget(tokens=100), Spent(prompt_tokens=90, completion_tokens=10), "tokens is used up"),
        (Budget(cost=1.0), Spent(cost=1.5), "dollars is used up"),
    ],
)
def test_nothing_is_asked_beyond_a_limit(budget: Budget, spent: Spent, limit: str) -> None:
    inner = Asked("a")
    with pytest.raises(LimitReached, match=limit):
        BoundedChat(inner, budget, lambda: spent).complete(QUESTION)
    assert not inner.left


def test_a_failure_at_the_end_of_the_time_is_the_end_of_the_time() -> None:
    spent = iter([Spent(seconds=1.0), Spent(seconds=1.0), Spent(seconds=9.99)])
    chat = BoundedChat(Asked(error=ChatError("too late")), Budget(seconds=10.0), lambda: next(spent))
    with pytest.raises(LimitReached, match="10 s"):
        chat.complete(QUESTION)


def test_a_failure_before_the_end_of_the_time_stays_a_failure() -> None:
    chat = BoundedChat(Asked(error=ChatError("refused")), Budget(seconds=10.0), lambda: Spent(seconds=1.0))
    with pytest.raises(ChatError, match="refused"):
        chat.complete(QUESTION)
