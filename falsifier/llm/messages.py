"""What travels to and from a language model, as frozen values that go into the journal as they are."""

from collections.abc import Mapping
from typing import Any, Literal, Protocol

from pydantic import BaseModel, ConfigDict, Field

Role = Literal["system", "user", "assistant"]
Source = Literal["model", "script", "recording", "cache"]


class _Value(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Message(_Value):
    """One message of a conversation."""

    role: Role
    content: str


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


class ChatRequest(_Value):
    """What is asked.

    Everything that shapes the answer is either here or among the chat's own parameters.
    """

    messages: tuple[Message, ...]
    reply_schema: dict[str, Any] | None = Field(
        default=None, description="JSON Schema of the reply, strict subset."
    )
    sample: int = Field(default=0, description="Which of several answers to the same question this is.")
    room: int = Field(
        default=1, description="Multiplies the limit on tokens, after an answer that was cut off."
    )


class ChatReply(_Value):
    """What came back."""

    text: str
    reasoning: str = Field(default="", description="What the provider shows of the model's reasoning.")
    finish_reason: str = "stop"
    usage: Usage = Usage()
    seconds: float = 0.0
    attempts: int = 1
    parameters: dict[str, Any] = Field(default_factory=dict, description="What was sent beside the messages.")
    source: Source = "model"


class Exchange(_Value):
    """One question, its answer, and what was wrong with it if it was rejected."""

    model: str
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
    def model(self) -> str:
        """Name of the model, such as ``openai/gpt-5-mini``."""
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
