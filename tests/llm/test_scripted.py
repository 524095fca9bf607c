import pytest

from falsifier.errors import ChatError
from falsifier.llm.messages import ChatRequest, Message
from falsifier.llm.scripted import ScriptedChat

QUESTION = ChatRequest(messages=(Message(role="user", content="?"),))


def test_script_of_a_function_and_its_end() -> None:
    assert ScriptedChat(lambda request: request.messages[0].content).complete(QUESTION).text == "?"
    with pytest.raises(ChatError, match="contains only 1 line, but request 2 was made"):
        chat = ScriptedChat(["only"])
        chat.complete(QUESTION)
        chat.complete(QUESTION)
