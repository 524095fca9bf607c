"""Stand-ins for a language model: recordings and scripts."""

import pytest

from falsifier.errors import ChatError
from falsifier.llm.messages import ChatReply, ChatRequest, Exchange, Message
from falsifier.llm.replay import RecordedChat, ScriptedChat

QUESTION = ChatRequest(messages=(Message(role="user", content="?"),))


def exchange(text: str | None) -> Exchange:
    return Exchange(
        llm="openai/m",
        messages=QUESTION.messages,
        reply=None if text is None else ChatReply(text=text),
        problem="nobody there" if text is None else None,
    )


def test_plays_what_was_recorded_and_then_asks() -> None:
    inner = ScriptedChat(["three"], llm="openai/m")
    chat = RecordedChat([exchange("one"), exchange("two")], inner)
    replies = [chat.complete(QUESTION) for _ in range(3)]
    assert [r.text for r in replies] == ["one", "two", "three"]
    assert [r.source for r in replies] == ["recording", "recording", "script"]
    assert len(inner.requests) == 1


def test_a_recording_alone_ends() -> None:
    chat = RecordedChat([exchange("one")])
    assert chat.llm == "recording of openai/m"
    chat.complete(QUESTION)
    with pytest.raises(ChatError, match="ends after 1 exchange"):
        chat.complete(QUESTION)


def test_a_recorded_failure_happens_again() -> None:
    with pytest.raises(ChatError, match="nobody there"):
        RecordedChat([exchange(None)], ScriptedChat(["now there"])).complete(QUESTION)


def test_script_of_a_function_and_its_end() -> None:
    assert ScriptedChat(lambda request: request.messages[0].content).complete(QUESTION).text == "?"
    with pytest.raises(ChatError, match="contains only 1 line, but request 2 was made"):
        chat = ScriptedChat(["only"])
        chat.complete(QUESTION)
        chat.complete(QUESTION)


def test_a_script_keeps_what_it_was_asked_gives_whole_replies_and_raises_exceptions() -> None:
    whole = ChatReply(text="b", reasoning="hm")
    script: list[str | ChatReply | Exception] = [whole, ValueError("out of order"), "c"]
    chat = ScriptedChat(iter(script), llm="mine")
    assert chat.complete(QUESTION) is whole
    assert (chat.llm, chat.requests) == ("mine", [QUESTION])
    with pytest.raises(ValueError, match="out of order"):
        chat.complete(QUESTION)
    assert chat.complete(QUESTION).text == "c"
