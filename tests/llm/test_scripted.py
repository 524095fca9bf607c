import pytest

from falsifier.errors import ChatError
from falsifier.llm.messages import ChatReply, ChatRequest, Message
from falsifier.llm.replay import ScriptedChat

QUESTION = ChatRequest(messages=(Message(role="user", content="?"),))


def test_script_of_a_function_and_its_end() -> None:
    assert ScriptedChat(lambda request: request.messages[0].content).complete(QUESTION).text == "?"
    with pytest.raises(ChatError, match="contains only 1 line, but request 2 was made"):
        chat = ScriptedChat(["only"])
        chat.complete(QUESTION)
        chat.complete(QUESTION)


def test_it_keeps_what_it_was_asked_and_bears_a_name() -> None:
    chat = ScriptedChat(["a"], llm="mine")
    reply = chat.complete(QUESTION)
    assert (chat.llm, chat.requests) == ("mine", [QUESTION])
    assert (reply.text, reply.source, reply.usage.cost) == ("a", "script", 0.0)


def test_replies_are_given_whole_and_exceptions_are_raised() -> None:
    whole = ChatReply(text="b", reasoning="hm")
    script: list[str | ChatReply | Exception] = [whole, ValueError("out of order"), "c"]
    chat = ScriptedChat(iter(script))
    assert chat.complete(QUESTION) is whole
    with pytest.raises(ValueError, match="out of order"):
        chat.complete(QUESTION)
    assert chat.complete(QUESTION).text == "c"
