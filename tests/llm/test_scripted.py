"""Stand-ins for a language model: recordings and scripts."""

import pytest

from falsifier.errors import ChatError
from falsifier.llm.messages import ChatReply, ChatRequest, Exchange, Message
from falsifier.llm.scripted import RecordedChat, ScriptedChat

QUESTION = ChatRequest(messages=(Message(role="user", content="?"),))


def test_what_was_recorded_is_played_once_before_the_inner_chat_is_asked() -> None:
    said = Exchange(llm="openai/m", messages=QUESTION.messages, reply=ChatReply(text="one"))
    failed = Exchange(llm="openai/m", messages=QUESTION.messages, reply=None, problem="nobody there")
    rest, inner = iter([said, failed]), ScriptedChat(["new"])
    first, second = RecordedChat(rest, inner), RecordedChat(rest, inner)
    assert first.complete(QUESTION).source == "recording"
    with pytest.raises(ChatError, match="nobody there"):
        second.complete(QUESTION)
    assert second.complete(QUESTION).text == "new"


def test_script_of_a_function_and_its_end() -> None:
    assert ScriptedChat(lambda request: request.messages[0].content).complete(QUESTION).text == "?"
    with pytest.raises(ChatError, match="contains only 1 line, but request 2 was made"):
        chat = ScriptedChat(["only"])
        chat.complete(QUESTION)
        chat.complete(QUESTION)
