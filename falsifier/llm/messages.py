"""What travels to and from a language model, as frozen values that go into the journal as they are."""

from collections.abc import Mapping
from typing import Any, Literal, Protocol, get_args

from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer

Role = Literal["system", "user", "assistant", "tool"]
Source = Literal["llm", "script", "recording", "cache"]
# Ways to ask for JSON, from the strictest to the plainest.
Mode = Literal["json_schema", "json_object", "prompt"]
MODES: tuple[Mode, ...] = get_args(Mode)


class _Value(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def below(mode: Mode) -> Mode | None:
    """Next plainer way, or None."""
    rest = MODES[MODES.index(mode) + 1 :]
    return rest[0] if rest else None


class _MayUseTools(_Value):
    """Leaves out empty fields of tools: most messages have none, and a journal has many."""

    @model_serializer(mode="wrap")
    def _without_empty_fields(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {k: v for k, v in handler(self).items() if v or k not in _FIELDS_OF_TOOLS}


_FIELDS_OF_TOOLS = frozenset({"tools", "tool_calls", "tool_call_id", "echo"})


class Tool(_Value):
    """Something that an LLM may call before it answers."""

    name: str
    description: str
    parameters: dict[str, Any] = Field(description="JSON Schema of the arguments, strict subset.")


class ToolCall(_MayUseTools):
    """One call of a tool, as the LLM made it."""

    id: str
    name: str
    arguments: str = Field(description="JSON text; whether it is valid, the tool must see.")
    echo: dict[str, Any] = Field(
        default_factory=dict, description="What the provider wants back with the call, such as a signature."
    )


class Message(_MayUseTools):
    """One message of a conversation."""

    role: Role
    content: str
    tool_calls: tuple[ToolCall, ...] = Field(default=(), description="Of an assistant's message.")
    tool_call_id: str = Field(default="", description="Of a tool's message: the call that it answers.")
    echo: dict[str, Any] = Field(
        default_factory=dict, description="What the provider wants back with the message, such as thoughts."
    )


class Usage(_Value):
    """Tokens and money of one request."""

    prompt_tokens: int = 0
    completion_tokens: int = Field(default=0, description="Reasoning included.")
    reasoning_tokens: int = Field(
        default=0, description="Of the completion tokens, where the provider says so."
    )
    cost: float | None = Field(default=None, description="US dollars; None where the price is unknown.")
    estimated: bool = Field(
        default=False, description="The provider sent no counts; four characters make a token."
    )

    @property
    def tokens(self) -> int:
        """Tokens sent and received."""
        return self.prompt_tokens + self.completion_tokens


class ChatRequest(_MayUseTools):
    """What is asked.

    Everything that shapes the answer is either here or among the chat's own parameters.
    """

    messages: tuple[Message, ...]
    reply_schema: dict[str, Any] | None = Field(
        default=None, description="JSON Schema of the reply, strict subset."
    )
    tools: tuple[Tool, ...] = Field(default=(), description="What may be called before the answer.")
    sample: int = Field(default=0, description="Which of several answers to the same question this is.")
    room: int = Field(
        default=1, description="Multiplies the limit on tokens, after an answer that was cut off."
    )


class ChatReply(_MayUseTools):
    """What came back."""

    text: str
    tool_calls: tuple[ToolCall, ...] = Field(default=(), description="To be answered before there is a text.")
    echo: dict[str, Any] = Field(
        default_factory=dict, description="What the provider wants back with the calls, such as thoughts."
    )
    reasoning: str = Field(default="", description="What the provider shows of the LLM's reasoning.")
    finish_reason: str = "stop"
    usage: Usage = Usage()
    seconds: float = 0.0
    attempts: int = 1
    parameters: dict[str, Any] = Field(default_factory=dict, description="What was sent beside the messages.")
    source: Source = "llm"


class Exchange(_Value):
    """One question, its answer, and what was wrong with it if it was rejected."""

    llm: str
    messages: tuple[Message, ...]
    parameters: dict[str, Any] = Field(default_factory=dict)
    reply: ChatReply | None = Field(description="None when no answer came.")
    problem: str | None = Field(default=None, description="Why the answer was rejected, or why none came.")

    @property
    def usage(self) -> Usage:
        """Tokens and money of this exchange; an answer that never came costs nothing."""
        return Usage(cost=0.0) if self.reply is None else self.reply.usage

    @property
    def seconds(self) -> float:
        """Wall-clock seconds until the answer was there."""
        return 0.0 if self.reply is None else self.reply.seconds


class Chat(Protocol):
    """A language model, or something that wraps or plays one."""

    @property
    def llm(self) -> str:
        """Name of the LLM, such as ``openai/gpt-5-mini``."""
        ...

    @property
    def parameters(self) -> Mapping[str, Any]:
        """What is sent beside the messages, without secrets."""
        ...

    def complete(self, request: ChatRequest) -> ChatReply:
        """Answer a request.

        Raises:
            ChatError: when no answer can be had.
        """
        ...

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Hear that a reply proved valid and may be kept."""
        ...
