"""From the strictest way of asking for JSON down to the one that the server takes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from falsifier.llm.client import LiteLLMChat
from falsifier.llm.failures import FormatUnsupportedError
from falsifier.llm.messages import ChatReply, ChatRequest
from falsifier.llm.modes import Mode, below


@dataclass
class LadderChat:
    """Asks by JSON Schema, else for any JSON object, else in words; remembers what worked.

    Attributes:
        inner: the client, whose ``mode`` is where the ladder begins.
    """

    inner: LiteLLMChat
    _mode: Mode = field(init=False)

    def __post_init__(self) -> None:
        self._mode = self.inner.mode

    @property
    def model(self) -> str:
        """See Chat."""
        return self.inner.model

    @property
    def parameters(self) -> Mapping[str, Any]:
        """See Chat."""
        return self.inner.parameters

    @property
    def mode(self) -> Mode:
        """How the next reply is asked for."""
        return self._mode

    def complete(self, request: ChatRequest) -> ChatReply:
        """Answer, in the strictest form that the server takes."""
        while True:
            mode = self._mode
            try:
                return replace(self.inner, mode=mode).complete(request)
            except FormatUnsupportedError:
                plainer = below(mode)
                if plainer is None or request.reply_schema is None:
                    raise
                self._mode = plainer

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """See Chat."""
        self.inner.accepted(request, reply)
