"""A tool that adds, and a question that offers it."""

import json

from falsifier.llm.conversation import RejectedReplyError, converse
from falsifier.llm.messages import ChatReply, ChatRequest, Exchange, Message, Tool, ToolCall
from falsifier.llm.replay import ScriptedChat

ADD = Tool(
    name="add",
    description="Adds.",
    parameters={
        "type": "object",
        "properties": {"terms": {"type": "array", "items": {"type": "number"}}},
        "required": ["terms"],
        "additionalProperties": False,
    },
)
SCHEMA = {
    "type": "object",
    "properties": {"sum": {"type": "number"}},
    "required": ["sum"],
    "additionalProperties": False,
}
QUESTION = ChatRequest(
    messages=(Message(role="user", content="what is 1 + 2?"),), reply_schema=SCHEMA, tools=(ADD,)
)
PLAIN = QUESTION.model_copy(update={"tools": ()})


def add(call: ToolCall) -> str:
    try:
        return str(sum(json.loads(call.arguments)["terms"]))
    except (ValueError, KeyError) as error:
        raise RejectedReplyError(f"no terms: {error!r}") from None


def calling(*terms: float, id: str = "c1") -> ChatReply:
    call = ToolCall(id=id, name="add", arguments=json.dumps({"terms": terms}))
    return ChatReply(text="", tool_calls=(call,), finish_reason="tool_calls")


def wrong(id: str = "w") -> ChatReply:
    return ChatReply(text="", tool_calls=(ToolCall(id=id, name="add", arguments="{}"),))


def ask_with_tools(*script: str | ChatReply) -> tuple[str, ScriptedChat, list[Exchange]]:
    chat, exchanges = ScriptedChat(script), list[Exchange]()
    return converse(chat, QUESTION, str.strip, exchanges.append, respond=add), chat, exchanges
