"""Stand-ins for a language model: playback of recorded conversations, and scripts.

Resumed runs pay for nothing twice; tests, tutorials and dry runs need no key.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from falsifier.core.words import counted
from falsifier.errors import ChatError
from falsifier.llm.messages import Chat, ChatReply, ChatRequest, Exchange, Usage

Line = str | ChatReply | Exception
Script = Iterable[Line] | Callable[[ChatRequest], Line]


@dataclass(frozen=True, slots=True)
class RecordedChat:
    """Answers with recorded replies in their order, then asks an inner chat.

    Attributes:
        rest: what was recorded and not played yet, in order; chats that share it play each reply once.
        inner: chat to ask after that.
    """

    rest: Iterator[Exchange]
    inner: Chat

    @property
    def llm(self) -> str:
        """Name of the inner chat's LLM."""
        return self.inner.llm

    def complete(self, request: ChatRequest) -> ChatReply:
        """Return the next recorded reply, or the inner chat's.

        Raises:
            ChatError: if a failure was recorded, or there is no reply now.
        """
        recorded = next(self.rest, None)
        if recorded is None:
            return self.inner.complete(request)
        if recorded.reply is None:
            raise ChatError(recorded.problem or "there was no reply")
        return recorded.reply.model_copy(update={"source": "recording"})

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Tell the inner chat."""
        self.inner.accepted(request, reply)


@dataclass
class ScriptedChat:
    """Answers from a list, an iterator or a function; an exception in the script is raised.

    Attributes:
        script: replies in order, or a function of the request.
        llm: name to show.
        requests: what it was asked, in order.
    """

    script: Script
    llm: str = "scripted"
    requests: list[ChatRequest] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._lines: Iterator[Line] = iter(() if callable(self.script) else self.script)

    def complete(self, request: ChatRequest) -> ChatReply:
        """Return the next line of the script.

        Raises:
            ChatError: if the script has ended.
        """
        self.requests.append(request)
        asked = len(self.requests)
        line = self.script(request) if callable(self.script) else next(self._lines, None)
        if line is None:
            raise ChatError(
                f"the script of {self.llm!r} contains only {counted(asked - 1, 'line')}, but request {asked} "
                "was made: add lines, or use a function"
            )
        if isinstance(line, Exception):
            raise line
        if isinstance(line, ChatReply):
            return line
        return ChatReply(text=line, usage=Usage(cost=0.0), source="script")

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Do nothing: a script's replies are not worth storing."""
