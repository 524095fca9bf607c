import pytest

from falsifier.errors import ChatError, SpecError
from falsifier.llm.messages import ChatReply, ChatRequest, Exchange, Message, Usage
from falsifier.llm.scripted import ScriptedChat
from falsifier.search.budget import Budget, LimitReached, RunChat, Spent


@pytest.mark.parametrize(
    ("budget", "spent", "reason"),
    [
        (Budget(3), Spent(simulations=3), "3 simulations"),
        (Budget(None, seconds=2), Spent(seconds=2.5), "2 s"),
        (Budget(None, tokens=100), Spent(prompt_tokens=60, completion_tokens=50), "100 tokens"),
        (Budget(None, cost=0.5), Spent(cost=0.51), "0.5 US dollars"),
    ],
)
def test_the_first_limit_that_is_reached_is_named(budget: Budget, spent: Spent, reason: str) -> None:
    assert budget.exceeded(Spent()) is None
    exceeded = budget.exceeded(spent)
    assert exceeded is not None
    assert reason in exceeded


def test_an_unknown_price_stays_unknown_and_forbids_a_limit_on_money() -> None:
    once = Usage(prompt_tokens=10, completion_tokens=5, reasoning_tokens=2, cost=0.01)
    known = Spent(simulations=1) + Spent.on_requests(1, once)
    unknown = known + Spent.on_requests(3, Usage(prompt_tokens=10, completion_tokens=5, without_reply=2))
    assert known.cost == pytest.approx(0.01)
    assert (unknown + known).cost is None
    assert (unknown.simulations, unknown.calls, unknown.without_reply) == (1, 4, 2)
    kept = Exchange(llm="m", messages=(), reply=ChatReply(text="", usage=Usage(cost=0.0, kept=1)))
    again = known + Spent.on_requests(kept.requests, kept.usage)
    assert (again.calls, again.kept, again.questions, again.cost) == (1, 1, 2, known.cost)
    assert unknown.tokens == 30
    with pytest.raises(SpecError, match="price of this language model is unknown"):
        Budget(None, cost=1.0).exceeded(unknown)


def test_a_budget_needs_a_positive_limit() -> None:
    with pytest.raises(SpecError, match="at least one limit"):
        Budget(None)
    with pytest.raises(SpecError, match="simulations: expected a whole number, at least 1, got 0"):
        Budget(0)


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
    chat = RunChat(inner, Budget(simulations=9, seconds=100.0), lambda: Spent(seconds=40.0), iter(()))
    assert chat.complete(QUESTION).text == "a"
    assert inner.left[0] is not None and 0 < inner.left[0] <= 60.0


def test_nothing_is_asked_beyond_a_limit() -> None:
    inner, spent = Asked("a"), Spent(prompt_tokens=90, completion_tokens=10)
    with pytest.raises(LimitReached, match="tokens is used up"):
        RunChat(inner, Budget(tokens=100), lambda: spent, iter(())).complete(QUESTION)
    assert not inner.left


def test_a_failure_at_the_end_of_the_time_is_the_end_of_the_time() -> None:
    spent = iter([Spent(seconds=1.0), Spent(seconds=1.0), Spent(seconds=9.99)])
    asked = Asked(error=ChatError("too late"))
    chat = RunChat(asked, Budget(seconds=10.0), lambda: next(spent), iter(()))
    with pytest.raises(LimitReached, match="10 s"):
        chat.complete(QUESTION)


def test_what_was_recorded_is_played_once_and_costs_nothing_before_the_model_is_asked() -> None:
    said = Exchange(llm="openai/m", messages=QUESTION.messages, reply=ChatReply(text="one"))
    failed = Exchange(llm="openai/m", messages=QUESTION.messages, reply=None, problem="nobody there")
    spent, recorded = iter([Spent(), Spent()]), iter([said, failed])
    first, second = (
        RunChat(ScriptedChat(["new"]), Budget(tokens=9), lambda: next(spent), recorded) for _ in range(2)
    )
    assert first.complete(QUESTION).source == "recording"
    with pytest.raises(ChatError, match="nobody there"):
        second.complete(QUESTION)
    assert second.complete(QUESTION).text == "new"
