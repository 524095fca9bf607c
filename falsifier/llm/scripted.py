"""A script in place of a language model: tests, tutorials and dry runs need no key."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from falsifier.core.words import counted
from falsifier.errors import ChatError
from falsifier.llm.messages import ChatReply, ChatRequest, Usage

Line = str | ChatReply | Exception
Script = Iterable[Line] | Callable[[ChatRequest], Line]


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
        """Return the next line of the script; ChatError if the script has ended."""
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
