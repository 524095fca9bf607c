"""A question whose reply follows a schema."""

from falsifier.llm.messages import ChatRequest, Message

SCHEMA = {
    "type": "object",
    "properties": {"sum": {"type": "number"}},
    "required": ["sum"],
    "additionalProperties": False,
}
QUESTION = ChatRequest(messages=(Message(role="user", content="what is 1 + 2?"),), reply_schema=SCHEMA)
