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


def test_a_recording_alone_ends() -> None:
    chat = RecordedChat([exchange("one")])
    assert chat.llm == "recording of openai/m"
    chat.complete(QUESTION)
    with pytest.raises(ChatError, match="recording of openai/m has no further exchange"):
        chat.complete(QUESTION)


def test_script_of_a_function_and_its_end() -> None:
    assert ScriptedChat(lambda request: request.messages[0].content).complete(QUESTION).text == "?"
    with pytest.raises(ChatError, match="contains only 1 line, but request 2 was made"):
        chat = ScriptedChat(["only"])
        chat.complete(QUESTION)
        chat.complete(QUESTION)
