"""Questions, one of which wants a reply that follows a schema, and a chat whose server is a script."""

from dataclasses import dataclass, field

from falsifier.llm.client import LiteLLMChat
from falsifier.llm.json_text import schema_of_object
from falsifier.llm.messages import ChatReply, ChatRequest, Message
from falsifier.llm.scripted import ScriptedChat

PLAIN = ChatRequest(messages=(Message(role="user", content="?"),))
QUESTION = ChatRequest(
    messages=(Message(role="user", content="what is 1 + 2?"),),
    reply_schema=schema_of_object(sum={"type": "number"}),
)


@dataclass
class Served(LiteLLMChat):
    """Each request that it sends is answered by a script."""

    llm: str = "openai/mine"
    server: ScriptedChat = field(default_factory=lambda: ScriptedChat(()))

    def send(self, request: ChatRequest) -> ChatReply:
        return self.server.complete(request)
