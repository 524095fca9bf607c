"""Asking again with what was wrong."""

import signal
from unittest.mock import Mock

import pytest

from falsifier.errors import ChatError, ContextExceededError
from falsifier.llm.conversation import NoValidReplyError, RejectedReplyError, converse
from falsifier.llm.messages import ChatReply, ChatRequest, Exchange, Message
from falsifier.llm.scripted import ScriptedChat

QUESTION = ChatRequest(messages=(Message(role="user", content="a number, please"),))


def number(text: str) -> int:
    if not text.isdigit():
        raise RejectedReplyError(f"{text!r} is no number")
    return int(text)


def asked(*script: str | ChatReply | Exception) -> tuple[int, ScriptedChat, list[Exchange]]:
    exchanges: list[Exchange] = []
    chat = ScriptedChat(script)
    return converse(chat, QUESTION, number, exchanges.append), chat, exchanges


@pytest.mark.parametrize(
    "reply",
    [ChatReply(text="0"), ChatReply(text="0", finish_reason="length"), ChatReply(text="", reasoning="0")],
)
def test_a_complete_answer_is_read_wherever_it_stands(reply: ChatReply) -> None:
    value, chat, (exchange,) = asked(reply)
    assert value == 0 and exchange.problem is None and len(chat.requests) == 1


def test_a_rejected_reply_goes_back_with_its_problem() -> None:
    value, chat, exchanges = asked("seven", "7")
    assert value == 7
    again = chat.requests[1].messages
    assert [m.role for m in again] == ["user", "assistant", "user"]
    assert again[1].content == "seven"
    assert "'seven' is no number" in again[2].content
    assert [e.problem for e in exchanges] == ["'seven' is no number", None]


def test_two_reasks_at_most() -> None:
    exchanges: list[Exchange] = []
    chat = ScriptedChat(["a", "b", "c", "4"])
    with pytest.raises(NoValidReplyError, match=r"no valid reply in 3 attempts.*'a'.*'b'.*'c'"):
        converse(chat, QUESTION, number, exchanges.append)
    assert len(chat.requests) == len(exchanges) == 3
    with pytest.raises(NoValidReplyError) as found:
        converse(ScriptedChat(["a", "a", "a"]), QUESTION, number, exchanges.append)
    assert str(found.value).count("'a'") == 1


@pytest.mark.parametrize(
    ("reply", "problem"),
    [
        (ChatReply(text=""), "empty"),
        (ChatReply(text="", reasoning="7", finish_reason="length"), "cut off"),
        (ChatReply(text="no", finish_reason="refusal"), "refuses"),
        (ChatReply(text="", finish_reason="content_filter"), "content filter"),
        (
            ChatReply(text="{}", finish_reason="call of the tool 'go'"),
            "a call of the tool 'go' in place of an",
        ),
    ],
)
def test_useless_replies_are_named(reply: ChatReply, problem: str) -> None:
    value, chat, exchanges = asked(reply, "7")
    assert value == 7
    assert problem in (exchanges[0].problem or "")
    assert problem in chat.requests[1].messages[-1].content


def test_a_reply_that_was_cut_off_gets_more_room_once() -> None:
    cut = ChatReply(text="", finish_reason="length")
    _, chat, _ = asked(cut, cut, "7")
    assert [r.max_tokens for r in chat.requests] == [0, 4000, 4000]
    long = ChatReply(text="", finish_reason="length", parameters={"max_tokens": 5000})
    _, chat, _ = asked(long, "7")
    assert [r.max_tokens for r in chat.requests] == [0, 10_000]
    with pytest.raises(NoValidReplyError, match=r"max_tokens.*or less effort \(effort='low'\)"):
        asked(cut, cut, cut)


def test_a_runaway_reply_is_not_quoted_in_full() -> None:
    _, chat, _ = asked("x" * 100_000, "7")
    assert len(chat.requests[1].messages[1].content) < 5000


def test_no_answer_is_not_asked_again_here() -> None:
    exchanges: list[Exchange] = []
    chat = ScriptedChat([ChatError("nobody there"), "7"])
    with pytest.raises(ChatError, match="nobody there"):
        converse(chat, QUESTION, number, exchanges.append)
    assert exchanges == []


def test_a_question_that_outgrows_the_context_when_asked_again_has_no_valid_reply() -> None:
    with pytest.raises(NoValidReplyError, match=r"2 attempts; rejected because: 'x' is no number.*too long"):
        asked("x", ContextExceededError("too long"))
    with pytest.raises(ContextExceededError):
        asked(ContextExceededError("too long"))


def test_more_can_follow_a_reason_that_ends_with_a_full_stop() -> None:
    chat = ScriptedChat(lambda _: ChatReply(text="I cannot attack systems.", finish_reason="refusal"))
    with pytest.raises(NoValidReplyError, match=r"attack systems$"):
        converse(chat, QUESTION, str, lambda _: None)
    assert "attack systems.\nReply again" in chat.requests[1].messages[-1].content


def test_a_script_may_be_a_function_and_says_when_it_ends() -> None:
    assert (
        ScriptedChat(lambda request: request.messages[0].content).complete(QUESTION).text
        == "a number, please"
    )
    chat = ScriptedChat(["only"])
    chat.complete(QUESTION)
    with pytest.raises(ChatError, match="contains only 1 line, but request 2 was made"):
        chat.complete(QUESTION)


@pytest.mark.usefixtures("stoppable")
def test_a_reply_that_was_paid_for_is_recorded_though_ctrl_c_comes_while_it_is_read() -> None:
    def read(text: str) -> int:
        signal.raise_signal(signal.SIGINT)
        return number(text)

    exchanges: list[Exchange] = []
    with pytest.raises(KeyboardInterrupt):
        converse(ScriptedChat(["7"]), QUESTION, read, exchanges.append)
    assert [e.problem for e in exchanges] == [None]


def test_a_reply_is_kept_for_later_runs_though_the_run_cannot_record_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kept = Mock()
    monkeypatch.setattr(ScriptedChat, "accepted", kept)
    with pytest.raises(OSError, match="full"):
        converse(ScriptedChat(["7"]), QUESTION, number, Mock(side_effect=OSError("full")))
    assert kept.call_count == 1
