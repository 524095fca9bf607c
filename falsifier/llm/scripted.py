"""A chat that follows a script, for tests, tutorials and dry runs."""

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

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
        self._lines: Iterator[Line] | None = None if callable(self.script) else iter(self.script)
        self._lock = threading.Lock()

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Empty: nothing is sent."""
        return {}

    def complete(self, request: ChatRequest) -> ChatReply:
        """Return the next line of the script.

        Raises:
            ChatError: if the script has ended.
        """
        with self._lock:
            self.requests.append(request)
            line = self._next(request)
        if isinstance(line, Exception):
            raise line
        if isinstance(line, ChatReply):
            return line
        return ChatReply(text=line, usage=Usage(cost=0.0), source="script")

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Do nothing: a script's replies are not worth storing."""

    def _next(self, request: ChatRequest) -> Line:
        if callable(self.script):
            return self.script(request)
        assert self._lines is not None
        try:
            return next(self._lines)
        except StopIteration:
            asked = len(self.requests)
            raise ChatError(
                f"the script of {self.llm!r} contains only {counted(asked - 1, 'line')}, but request {asked} "
                "was made: add lines, or use a function"
            ) from None
