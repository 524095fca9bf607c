"""Patience with passing failures."""

from time import monotonic

import pytest

from falsifier.errors import ChatError
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.failures import TransientChatError
from falsifier.llm.messages import ChatReply, ChatRequest, Usage
from falsifier.llm.scripted import ScriptedChat
from falsifier.search.budget import Budget, LimitReached, RunChat, Spent
from tests.llm.server import Step, serving
from tests.llm.support import PLAIN, Served


@pytest.fixture(autouse=True)
def naps(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """How long it waited, in s; nobody waits here."""
    waited: list[float] = []
    monkeypatch.setattr("falsifier.llm.client.sleep", waited.append)
    return waited


def asked(chat: ScriptedChat, *, attempts: int = 7, within: float | None = None) -> ChatReply:
    deadline = None if within is None else monotonic() + within
    question = PLAIN.model_copy(update={"deadline": deadline})
    return Served(attempts=attempts, server=chat).complete(question)


def test_waits_longer_each_time_and_counts_attempts(naps: list[float]) -> None:
    passing = TransientChatError("busy")
    reply = asked(ScriptedChat([passing, passing, passing, "done"]))
    assert reply.text == "done"
    assert reply.attempts == 4
    assert [round(n) for n in naps] == sorted(round(n) for n in naps)
    assert 0.75 <= naps[0] <= 1.25
    assert 3 <= naps[2] <= 5


@pytest.mark.parametrize(
    ("failure", "said", "asked_for"),
    [
        (TransientChatError("busy"), "3 attempts failed, the last one so: busy", 3),
        (ChatError("no such model"), "no such model", 1),
        (TransientChatError("limit", retry_after=3600.0), "3600 s", 1),
    ],
)
def test_it_ends_where_waiting_does_not_help(failure: ChatError, said: str, asked_for: int) -> None:
    chat = ScriptedChat(lambda _: failure)
    with pytest.raises(ChatError, match=said) as caught:
        asked(chat, attempts=3)
    assert not isinstance(caught.value, TransientChatError)
    assert len(chat.requests) == asked_for


@pytest.mark.parametrize(
    "raw", ["<html>Sign in</html>", "null", "[]", '{"choices": [{"message": {"content": 5}}]}'], ids=str
)
def test_malformed_replies_are_asked_for_three_times(raw: str) -> None:
    with serving(*[Step(status=503)] * 3, *[Step(raw=raw)] * 4) as server:
        with pytest.raises(ChatError, match=r"6 attempts failed, the last one so: .*the reply"):
            LiteLLMChat("openai/mine", api_base=server.url).complete(PLAIN)
        assert len(server.received) == 6


@pytest.mark.parametrize("step", [Step(status=503), Step(raw='{"error": {"message": "busy"}}')], ids=str)
def test_a_server_that_says_it_is_busy_is_given_more_time(step: Step) -> None:
    with serving(*[step] * 6, Step("done")) as server:
        assert LiteLLMChat("openai/mine", api_base=server.url).complete(PLAIN).text == "done"


def test_a_wait_beyond_the_deadline_is_not_begun(naps: list[float]) -> None:
    chat = ScriptedChat([TransientChatError("busy", retry_after=50.0), "late"])
    with pytest.raises(ChatError, match=r"no time is left to ask again\. busy"):
        asked(chat, within=20.0)
    assert naps == []


LATE, IN_VAIN = TransientChatError("late"), ChatError("not readable")
LATE.lost = Usage(prompt_tokens=50, cost=0.5, estimated=True, without_reply=1)
IN_VAIN.lost = Usage(prompt_tokens=9, cost=0.25, estimated=True, without_reply=1)


def test_requests_that_timed_out_are_counted_as_paid() -> None:
    usage = asked(ScriptedChat([LATE, LATE, "yes"])).usage
    assert (usage.without_reply, usage.estimated) == (2, True)
    plain = ScriptedChat(["yes"]).complete(PLAIN).usage
    assert usage.prompt_tokens == plain.prompt_tokens + 100
    assert usage.cost == (None if plain.cost is None else plain.cost + 1.0)
    with pytest.raises(ChatError) as caught:
        asked(ScriptedChat([LATE, LATE]), attempts=2)
    assert caught.value.lost == Usage(prompt_tokens=100, cost=1.0, estimated=True, without_reply=2)
    for limit, told in ((Budget(tokens=80), "80 tokens"), (Budget(cost=0.8), "0.8 US dollars")):
        server = ScriptedChat([LATE] * 3)
        with pytest.raises(LimitReached, match=f"{told} is used up"):
            RunChat(Served(server=server), limit, Spent, iter(())).complete(PLAIN)
        assert len(server.requests) == 2


@pytest.mark.parametrize("ending", [KeyboardInterrupt(), ChatError("no such model"), IN_VAIN], ids=repr)
def test_requests_that_timed_out_are_counted_however_the_wait_for_a_reply_ends(ending: BaseException) -> None:
    failures = iter([LATE, ending])
    own = getattr(ending, "lost", None) or Usage(cost=0.0)

    def fail(_: ChatRequest) -> str:
        raise next(failures)

    with pytest.raises(type(ending)) as ended:
        asked(ScriptedChat(fail))
    assert getattr(ended.value, "lost", None) == LATE.lost + own
