"""Patience with passing failures, shared between runs."""

from types import SimpleNamespace

import pytest

from falsifier.errors import ChatError
from falsifier.llm.failures import TransientChatError
from falsifier.llm.messages import ChatReply, ChatRequest, Message, Usage
from falsifier.llm.replay import ScriptedChat
from falsifier.llm.retry import Gate, retried

QUESTION = ChatRequest(messages=(Message(role="user", content="?"),))


def asked(chat: ScriptedChat, gate: Gate, *, attempts: int = 7, within: float | None = None) -> ChatReply:
    return retried(lambda: chat.complete(QUESTION), gate, attempts=attempts, seconds_left=lambda: within)


def test_waits_longer_each_time_and_counts_attempts() -> None:
    naps: list[float] = []
    passing = TransientChatError("busy")
    reply = asked(ScriptedChat([passing, passing, passing, "done"]), Gate(sleep=naps.append))
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
        asked(chat, Gate(sleep=lambda _: None), attempts=3)
    assert not isinstance(caught.value, TransientChatError)
    assert len(chat.requests) == asked_for


@pytest.mark.parametrize(("for_all", "held_up"), [(True, 30.0), (False, 0.0)])
def test_a_rate_limit_holds_up_all_runs_of_a_gate(
    for_all: bool, held_up: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, others = 100.0, []

    def sleep(seconds: float) -> None:
        nonlocal now
        others.append(max(gate.remaining(), 0.0))
        now += seconds

    monkeypatch.setattr("falsifier.llm.retry.time", SimpleNamespace(monotonic=lambda: now))
    gate = Gate(sleep=sleep)
    limit = TransientChatError("limit", retry_after=30.0, for_all=for_all)
    assert asked(ScriptedChat([limit, "a"]), gate).text == "a"
    assert others == [held_up]
    assert now == 130.0


def test_a_slot_and_the_end_of_a_pause_are_waited_for_only_so_long() -> None:
    gate = Gate(concurrency=1, sleep=lambda _: None)
    with (
        gate.passage(),
        pytest.raises(ChatError, match=r"other requests .* are still waiting"),
        gate.passage(0.0),
    ):
        pass
    gate.pause(100.0)
    gate.pause(5.0)
    with pytest.raises(ChatError, match="pause for another 100 s"), gate.passage(10.0):
        pass
    assert gate._slots.acquire(blocking=False), "the slot is free"


def test_a_wait_beyond_the_deadline_is_not_begun() -> None:
    naps: list[float] = []
    chat = ScriptedChat([TransientChatError("busy", retry_after=50.0), "late"])
    with pytest.raises(ChatError, match=r"no time is left to ask again\. busy"):
        asked(chat, Gate(sleep=naps.append), within=20.0)
    assert naps == []


def test_requests_that_timed_out_are_counted_as_paid() -> None:
    late = TransientChatError("late")
    late.lost = Usage(prompt_tokens=50, cost=0.5, estimated=True, timed_out=1)
    usage = asked(ScriptedChat([late, late, "yes"]), Gate(sleep=lambda _: None)).usage
    assert (usage.timed_out, usage.estimated) == (2, True)
    plain = ScriptedChat(["yes"]).complete(QUESTION).usage
    assert usage.prompt_tokens == plain.prompt_tokens + 100
    assert usage.cost == (None if plain.cost is None else plain.cost + 1.0)
    with pytest.raises(ChatError) as caught:
        asked(ScriptedChat([late, late]), Gate(sleep=lambda _: None), attempts=2)
    assert caught.value.lost == Usage(prompt_tokens=100, cost=1.0, estimated=True, timed_out=2)
