"""From the strictest way of asking, by schema and with tools, down to the one that the server takes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from falsifier.errors import ChatError
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.failures import FormatUnsupportedError, ToolsUnsupportedError
from falsifier.llm.litellm_import import may_take_tools
from falsifier.llm.messages import MODES, ChatReply, ChatRequest, Mode, below


@dataclass
class LadderChat:
    """Asks by JSON Schema, else for any JSON object, else in words; remembers what worked.

    Questions that offer tools have a ladder of their own, for servers take both and refuse them together;
    below its last rung, or where tools are refused as such, they are asked without tools.

    Attributes:
        inner: the client, whose ``mode`` is where the ladder begins.
    """

    inner: LiteLLMChat
    _mode: Mode = field(init=False)
    _mode_with_tools: Mode = field(init=False)
    _takes_tools: bool | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self._mode = self._mode_with_tools = self.inner.mode

    @property
    def llm(self) -> str:
        """See Chat."""
        return self.inner.llm

    @property
    def parameters(self) -> Mapping[str, Any]:
        """See Chat."""
        return self.inner.parameters

    @property
    def mode(self) -> Mode:
        """How the next reply is asked for, without tools."""
        return self._mode

    def complete(self, request: ChatRequest) -> ChatReply:
        """Answer, in the strictest form that the server takes."""
        if request.tools and not self._may_offer_tools():
            request = _without_tools(request)
        while True:
            mode = max(self._mode, self._mode_with_tools, key=MODES.index) if request.tools else self._mode
            try:
                return replace(self.inner, mode=mode).complete(request)
            except FormatUnsupportedError:
                plainer = below(mode) if request.reply_schema is not None else None
                if plainer is None and not request.tools:
                    raise
                if plainer is None:
                    request = self._refused_with_tools(request)
                elif request.tools:
                    self._mode_with_tools = plainer
                else:
                    self._mode = plainer
            except ToolsUnsupportedError:
                request = self._refused_with_tools(request)

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """See Chat."""
        self.inner.accepted(request, reply)

    def _may_offer_tools(self) -> bool:
        if self._takes_tools is None:
            self._takes_tools = may_take_tools(self.llm, api_base=self.inner.api_base)
        return self._takes_tools

    def _refused_with_tools(self, request: ChatRequest) -> ChatRequest:
        """Remember that tools are refused; return the question without them."""
        if any(message.role == "tool" for message in request.messages):
            raise ChatError(f"{self.llm}: the server took a tool first and refused it in the same turn")
        self._takes_tools = False
        return _without_tools(request)


def _without_tools(request: ChatRequest) -> ChatRequest:
    return request.model_copy(update={"tools": ()})
