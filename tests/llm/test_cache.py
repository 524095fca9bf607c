from pathlib import Path

import pytest

from falsifier.errors import ChatError
from falsifier.llm.connect import CachedChat
from falsifier.llm.conversation import converse
from falsifier.llm.messages import ChatReply, ChatRequest, Message, Tool, ToolCall, Usage
from falsifier.llm.replay import ScriptedChat

QUESTION = ChatRequest(messages=(Message(role="user", content="?"),))
PAID = ChatReply(text="answer", usage=Usage(prompt_tokens=10, completion_tokens=5, cost=0.01), seconds=3.0)


def test_valid_replies_are_kept_and_cost_nothing_again(tmp_path: Path) -> None:
    inner = ScriptedChat([PAID, "never"])
    chat = CachedChat(inner, tmp_path)
    chat.accepted(QUESTION, chat.complete(QUESTION))
    again = CachedChat(inner, tmp_path).complete(QUESTION)
    assert again.text == "answer"
    assert again.source == "cache"
    assert again.usage == Usage(cost=0.0)
    assert len(inner.requests) == 1


def test_rejected_replies_are_not_kept(tmp_path: Path) -> None:
    chat = CachedChat(ScriptedChat(["bad", "good"]), tmp_path)
    assert chat.complete(QUESTION).text == "bad"
    assert chat.complete(QUESTION).text == "good"


def test_everything_that_is_sent_is_part_of_the_question(tmp_path: Path) -> None:
    kept = CachedChat(ScriptedChat(["one"], llm="a"), tmp_path)
    kept.accepted(QUESTION, kept.complete(QUESTION))
    others = [
        QUESTION.model_copy(update={"sample": 1}),
        QUESTION.model_copy(update={"reply_schema": {"type": "object"}}),
        QUESTION.model_copy(update={"messages": (Message(role="system", content="?"),)}),
    ]
    for other in others:
        assert CachedChat(ScriptedChat(["two"], llm="a"), tmp_path).complete(other).text == "two"
    assert CachedChat(ScriptedChat(["two"], llm="b"), tmp_path).complete(QUESTION).text == "two"


def test_a_damaged_file_is_asked_for_again(tmp_path: Path) -> None:
    chat = CachedChat(ScriptedChat([PAID, "anew"]), tmp_path)
    chat.accepted(QUESTION, chat.complete(QUESTION))
    (file,) = tmp_path.rglob("*.json")
    file.write_text("{")
    assert chat.complete(QUESTION).text == "anew"


def test_nothing_else_is_left_behind(tmp_path: Path) -> None:
    chat = CachedChat(ScriptedChat([PAID]), tmp_path / "new" / "folder")
    reply = chat.complete(QUESTION)
    chat.accepted(QUESTION, reply)
    chat.accepted(QUESTION, reply)
    assert [p.suffix for p in tmp_path.rglob("*") if p.is_file()] == [".json"]


def test_calls_of_tools_are_kept_like_answers(tmp_path: Path) -> None:
    question = QUESTION.model_copy(update={"tools": (Tool(name="t", description="", parameters={}),)})
    call = ChatReply(text="", tool_calls=(ToolCall(id="1", name="t", arguments="{}"),), usage=PAID.usage)
    inner = ScriptedChat([call, PAID])
    for _ in range(2):
        text = converse(CachedChat(inner, tmp_path), question, str, lambda _: None, respond=lambda _: "seen")
        assert text == "answer"
    assert len(inner.requests) == 2
    # Another answer of the tool makes another question of what follows.
    with pytest.raises(ChatError, match="the script"):
        converse(CachedChat(inner, tmp_path), question, str, lambda _: None, respond=lambda _: "other")
