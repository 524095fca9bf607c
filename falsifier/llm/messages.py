"""What is sent to and received from a language model: frozen values, written to the journal unchanged."""

from collections.abc import Iterable
from math import inf
from time import monotonic
from typing import Any, Literal, Protocol, get_args

from pydantic import Field

from falsifier.core.arguments import instance
from falsifier.core.literals import printable
from falsifier.core.secrets import redact_held
from falsifier.core.strict import Strict

Role = Literal["system", "user", "assistant"]
Source = Literal["llm", "script", "recording", "cache"]
# Ways to ask for JSON, from the strictest to the plainest.
Mode = Literal["bounded_schema", "json_schema", "json_object", "prompt"]
MODES: tuple[Mode, ...] = get_args(Mode)
# How the finish reason of a reply begins that calls a tool; the tool's name follows.
TOOL_CALL = "call of the tool "
# Finish reason of a reply that the server could not parse in the form that was asked for.
UNREADABLE = "unreadable"
# Some 250,000 tokens, more than any LLM writes in one reply. What is longer is cut, and rejected when read.
LONGEST_REPLY = 1_000_000


class Message(Strict):
    """One message of a conversation."""

    role: Role
    content: str
    stable: int = Field(
        default=0,
        exclude_if=lambda count: not count,  # few messages have one, and a journal contains many messages
        description="Characters at its beginning that the next question will begin with, too.",
    )


class Usage(Strict):
    """Tokens and cost of one request."""

    prompt_tokens: int = 0
    completion_tokens: int = Field(default=0, description="Reasoning included.")
    cached_tokens: int = Field(
        default=0, description="Part of the prompt tokens that the provider had kept, if it reports it."
    )
    reasoning_tokens: int = Field(
        default=0, description="Part of the completion tokens, if the provider reports it."
    )
    cost: float | None = Field(default=None, description="US dollars; None if the price is unknown.")
    estimated: bool = Field(
        default=False, description="The provider sent no counts; counted with a usual tokenizer."
    )
    without_reply: int = Field(
        default=0,
        description="Requests among them that had no reply in time, or none that can be read; providers "
        "charge for them, so the tokens that were sent are counted.",
    )
    kept: int = Field(default=0, description="Replies that were taken from the cache, without a request.")

    @property
    def tokens(self) -> int:
        """Tokens sent and received."""
        return self.prompt_tokens + self.completion_tokens

    def __add__(self, other: "Usage") -> "Usage":
        costs = (self.cost, other.cost)
        counts = Usage.model_fields.keys() - {"cost", "estimated"}
        return Usage(
            **{name: getattr(self, name) + getattr(other, name) for name in counts},
            cost=None if None in costs else sum(cost or 0.0 for cost in costs),
            estimated=self.estimated or other.estimated,
        )


class ChatRequest(Strict):
    """One request.

    Everything that influences the reply is either here or among the parameters of ``LiteLLMChat``: together
    they are the key of the cache.
    """

    messages: tuple[Message, ...]
    reply_schema: dict[str, Any] | None = Field(
        default=None, description="JSON Schema of the reply, within the subset of strict servers."
    )
    sample: int = Field(
        default=0, description="Distinguishes runs that ask the same question and want different replies."
    )
    max_tokens: int = Field(
        default=0,
        description="Token limit after a reply that was cut off, if it is larger than the usual one.",
    )
    deadline: float | None = Field(
        default=None,
        exclude=True,
        description="Value of time.monotonic() at which to give up; it does not influence the reply.",
    )
    spare: tuple[float, float] = Field(
        default=(inf, inf),
        exclude=True,
        description="Tokens and US dollars that are left; once failures have used them, none is sent again.",
    )

    @property
    def seconds_left(self) -> float | None:
        """Seconds until the deadline, at least 0; None without a deadline."""
        return None if self.deadline is None else max(0.0, self.deadline - monotonic())


class ChatReply(Strict):
    """One reply."""

    text: str
    reasoning: str = Field(default="", description="The LLM's reasoning as far as the provider shows it.")
    finish_reason: str = "stop"
    usage: Usage = Usage()
    seconds: float = 0.0
    attempts: int = 1
    parameters: dict[str, Any] = Field(
        default_factory=dict, description="What was sent in addition to the messages."
    )
    source: Source = "llm"


class Exchange(Strict):
    """One request, its reply, and the defect of a rejected reply."""

    llm: str
    messages: tuple[Message, ...]
    reply: ChatReply | None = Field(description="None if there was no reply.")
    lost: Usage | None = Field(
        default=None, description="Requests without a usable reply, if there was none in the end."
    )
    problem: str | None = Field(
        default=None, description="Why the reply was rejected, or why there was none."
    )

    @property
    def usage(self) -> Usage:
        """Tokens and cost of this exchange; without a reply, those of requests in vain."""
        return self.lost or Usage(cost=0.0) if self.reply is None else self.reply.usage

    @property
    def requests(self) -> int:
        """Number of requests that were answered or timed out; at least 1, unless the reply is a kept one."""
        usage = self.usage
        return max(1, usage.without_reply + (self.reply is not None)) - usage.kept

    @property
    def seconds(self) -> float:
        """Wall-clock seconds until the reply arrived."""
        return 0.0 if self.reply is None else self.reply.seconds


def cleaned(reply: ChatReply, secrets: Iterable[str] = ()) -> ChatReply:
    """Return a reply without secrets and without what a terminal would act on, and not longer than the limit.

    An LLM or a server may repeat what it was sent; secrets of the environment need not be named.
    """
    instance("complete() of the chat", reply, ChatReply, "a falsifier.llm.messages.ChatReply")
    secrets = tuple(secrets)
    texts = {"text": reply.text, "reasoning": reply.reasoning, "finish_reason": reply.finish_reason}
    return reply.model_copy(
        update={k: redact_held(printable(sent[:LONGEST_REPLY]), secrets) for k, sent in texts.items()}
    )


class Chat(Protocol):
    """A language model, a wrapper around one, or a stand-in for one."""

    @property
    def llm(self) -> str:
        """Name of the LLM, such as ``openai/gpt-5-mini``."""
        ...

    def complete(self, request: ChatRequest) -> ChatReply:
        """Return the reply to a request; ChatError if no reply can be obtained."""
        ...

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Be notified that a reply proved valid and may be stored."""
        ...
