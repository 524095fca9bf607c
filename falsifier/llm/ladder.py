"""From the strictest way of asking, by schema and with tools, down to one that the server accepts."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from falsifier.errors import ChatError
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.failures import FormatUnsupportedError, ToolsUnsupportedError
from falsifier.llm.litellm_adapter import may_take_tools
from falsifier.llm.messages import MODES, UNREADABLE, ChatReply, ChatRequest, Mode, below

# Replies in a row that the server could not parse, before they are asked for in a plainer way: one is the
# LLM's mistake, several are the server's.
_MOST_UNREADABLE = 2


@dataclass
class LadderChat:
    """Asks by JSON Schema, else for any JSON object, else in words only; remembers what worked.

    The next way is tried if the server rejects one, or repeatedly cannot parse what it makes the LLM write.

    Requests that offer tools have their own ladder: some servers accept a schema and accept tools but reject
    the two together. Below its last step, or if the server rejects tools altogether, the request is sent
    without tools.

    Attributes:
        inner: the client; its ``mode`` is the first step.
    """

    inner: LiteLLMChat
    _mode: Mode = field(init=False)
    _mode_with_tools: Mode = field(init=False)
    _takes_tools: bool | None = field(init=False, default=None)
    _unreadable: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self._mode = self._mode_with_tools = self.inner.mode

    @property
    def llm(self) -> str:
        return self.inner.llm

    @property
    def parameters(self) -> Mapping[str, Any]:
        return self.inner.parameters

    @property
    def mode(self) -> Mode:
        """How the next reply will be asked for if no tools are offered."""
        return self._mode

    def complete(self, request: ChatRequest) -> ChatReply:
        """Ask in the strictest way that the server accepts."""
        if request.tools and not self._may_offer_tools():
            request = _without_tools(request)
        while True:
            mode = max(self._mode, self._mode_with_tools, key=MODES.index) if request.tools else self._mode
            try:
                return self._noted(request, mode, replace(self.inner, mode=mode).complete(request))
            except FormatUnsupportedError:
                plainer = below(mode) if request.reply_schema is not None else None
                if plainer is None and not request.tools:
                    raise
                if plainer is None:
                    request = self._refused_with_tools(request)
                else:
                    self._descend(request, plainer)
            except ToolsUnsupportedError:
                request = self._refused_with_tools(request)

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        self.inner.accepted(request, reply)

    def _noted(self, request: ChatRequest, mode: Mode, reply: ChatReply) -> ChatReply:
        """Return a reply; after several that the server could not parse, ask in a plainer way from now on."""
        self._unreadable = self._unreadable + 1 if reply.finish_reason == UNREADABLE else 0
        plainer = below(mode) if request.reply_schema is not None else None
        if self._unreadable >= _MOST_UNREADABLE and plainer is not None:
            self._unreadable = 0
            self._descend(request, plainer)
        return reply

    def _descend(self, request: ChatRequest, plainer: Mode) -> None:
        if request.tools:
            self._mode_with_tools = plainer
        else:
            self._mode = plainer

    def _may_offer_tools(self) -> bool:
        if self._takes_tools is None:
            self._takes_tools = may_take_tools(self.llm, api_base=self.inner.api_base)
        return self._takes_tools

    def _refused_with_tools(self, request: ChatRequest) -> ChatRequest:
        """Remember that the server rejects tools; return the request without them."""
        if any(message.role == "tool" for message in request.messages):
            # The conversation contains tool calls already, which cannot be sent without the tools.
            raise ChatError(
                f"{self.llm}: the server first accepted a tool, then rejected it in the same turn; "
                "use --engine llm, which offers no tools"
            )
        self._takes_tools = False
        return _without_tools(request)


def _without_tools(request: ChatRequest) -> ChatRequest:
    return request.model_copy(update={"tools": ()})
