"""Stand-ins for a language model: playback of recorded conversations, and scripts.

Resumed runs pay for nothing twice; tests, tutorials and dry runs need no key.
"""

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from falsifier.core.words import counted
from falsifier.errors import ChatError
from falsifier.llm.messages import Chat, ChatReply, ChatRequest, Exchange, Usage

Line = str | ChatReply | Exception
Script = Iterable[Line] | Callable[[ChatRequest], Line]


class Recording:
    """Recorded exchanges, each played once; several chats may share a recording.

    Args:
        exchanges: what was recorded, in order.
    """

    def __init__(self, exchanges: Iterable[Exchange]) -> None:
        self._exchanges = list(exchanges)
        self._rest = iter(self._exchanges)
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._exchanges)

    @property
    def llm(self) -> str:
        """The name to show for this recording: which LLM was recorded."""
        return f"recording of {self._exchanges[0].llm}" if self._exchanges else "empty recording"

    def next(self) -> Exchange | None:
        """Play the next exchange; None at the end."""
        with self._lock:
            return next(self._rest, None)


class RecordedChat:
    """Answers with recorded replies in their order, then asks an inner chat.

    Args:
        recording: what was recorded.
        inner: chat to ask after that; None: the end of the recording is an error.
    """

    def __init__(self, recording: Recording | Iterable[Exchange], inner: Chat | None = None) -> None:
        self.recording = recording if isinstance(recording, Recording) else Recording(recording)
        self._inner = inner

    @property
    def llm(self) -> str:
        """Name of the inner chat's LLM; without an inner chat, the recording's."""
        return self.recording.llm if self._inner is None else self._inner.llm

    @property
    def parameters(self) -> Mapping[str, Any]:
        return {} if self._inner is None else self._inner.parameters

    def complete(self, request: ChatRequest) -> ChatReply:
        """Return the next recorded reply.

        Raises:
            ChatError: if a failure was recorded, or the recording has ended and there is no inner chat.
        """
        recorded = self.recording.next()
        if recorded is not None:
            if recorded.reply is None:
                raise ChatError(recorded.problem or "there was no reply")
            return recorded.reply.model_copy(update={"source": "recording"})
        if self._inner is None:
            raise ChatError(f"the {self.llm} ends after {counted(len(self.recording), 'exchange')}")
        return self._inner.complete(request)

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        if self._inner is not None:
            self._inner.accepted(request, reply)


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
