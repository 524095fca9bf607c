"""An LLM behind litellm: asked in the strictest way that its server accepts, again after passing failures."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from time import perf_counter
from typing import Any

from falsifier.core.secrets import redact, secrets_in, without_secrets
from falsifier.errors import ChatError
from falsifier.llm.failures import (
    FormatUnsupportedError,
    ToolsUnsupportedError,
    UnreadableReplyError,
    classify,
)
from falsifier.llm.json_text import without_limits
from falsifier.llm.litellm_adapter import (
    calls_in,
    dropped_parameters,
    echo_of,
    listed_price,
    load_litellm,
    may_take_tools,
    sent_message,
    sent_tool,
    storable,
)
from falsifier.llm.messages import (
    MODES,
    UNREADABLE,
    ChatReply,
    ChatRequest,
    Mode,
    Usage,
    below,
    cleaned,
)
from falsifier.llm.providers import find_key, known, provider_of
from falsifier.llm.retry import DEFAULT_ATTEMPTS, FIRST_DELAY, Gate, retried
from falsifier.llm.transport import within
from falsifier.llm.usage import Price, lost_usage, usage_of

# In s; reasoning models may think for minutes.
DEFAULT_TIMEOUT = 600.0
# Replies in a row that the server could not parse, before they are asked for in a plainer way: one is the
# LLM's mistake, several are the server's.
_MOST_UNREADABLE = 2
# In s; the longest that a socket can wait is 2**31 ms.
_LONGEST_TIMEOUT = 2e6


@dataclass
class LiteLLMChat:
    """An LLM of any provider that litellm supports.

    It is asked by JSON Schema, else for any JSON object, else in words only; what worked is remembered. The
    next way is tried if the server rejects one, or repeatedly cannot parse what it makes the LLM write.
    Requests that offer tools have ways of their own: some servers accept a schema and accept tools but reject
    the two together. Below the last way, or if the server rejects tools altogether, they are sent without
    tools.

    Attributes:
        llm: litellm's name, e.g. ``openai/gpt-5-mini``.
        effort: reasoning effort, ``low``, ``medium`` or ``high``; None: the LLM's default.
        api_base: address of the server; None: the provider's own.
        options: further parameters of litellm's ``completion``, passed unchanged.
        timeout: seconds to wait for a complete reply.
        price: price stated by the user; None: litellm's table.
        mode: how the next reply that follows a schema is asked for, if no tools are offered.
        content: what the server serves, if it was started for a model file; records then say this instead
            of the server's address, which is another one each time.
        gate: shared between all runs that use the same account.
        attempts: maximum number of requests per reply if failures are temporary.
        first_delay: seconds before the second of them.
    """

    llm: str
    effort: str | None = None
    api_base: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    timeout: float = DEFAULT_TIMEOUT
    price: Price | None = None
    mode: Mode = "json_schema"
    content: str = ""
    gate: Gate = field(default_factory=Gate)
    attempts: int = DEFAULT_ATTEMPTS
    first_delay: float = FIRST_DELAY
    _mode_with_tools: Mode = field(init=False)
    _takes_tools: bool | None = field(init=False, default=None)
    _unreadable: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self._mode_with_tools = self.mode

    @property
    def parameters(self) -> Mapping[str, Any]:
        """What is sent in addition to the messages, without secrets."""
        address = (
            {"content": self.content}
            if self.content
            else {"api_base": self.api_base and redact(self.api_base)}
        )
        stated = {"effort": self.effort, **address}
        return {**{k: v for k, v in stated.items() if v is not None}, **without_secrets(self._options())}

    def complete(self, request: ChatRequest) -> ChatReply:
        """Ask in the strictest way that the server accepts, and again after temporary failures.

        Raises:
            ChatError: if no reply can be obtained.
        """
        return retried(
            lambda: self._asked(request),
            self.gate,
            attempts=self.attempts,
            first_delay=self.first_delay,
            seconds_left=lambda: request.seconds_left,
        )

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Do nothing; storing replies is CachedChat's concern."""

    def _asked(self, request: ChatRequest) -> ChatReply:
        if request.tools and not self._may_offer_tools():
            request = _without_tools(request)
        while True:
            mode = max(self.mode, self._mode_with_tools, key=MODES.index) if request.tools else self.mode
            try:
                return self._noted(request, mode, self.send(request, mode))
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
            self.mode = plainer

    def _may_offer_tools(self) -> bool:
        if self._takes_tools is None:
            self._takes_tools = may_take_tools(self.llm, api_base=self.api_base)
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

    def send(self, request: ChatRequest, mode: Mode | None = None) -> ChatReply:
        """Send one request.

        Args:
            request: what is sent.
            mode: how to ask for a reply that follows a schema; None: as the next one is asked for.

        Returns:
            The reply; one without text, and with the finish reason ``UNREADABLE``, if the server could not
            parse what the LLM wrote.

        Raises:
            TransientChatError: if a retry may succeed.
            FormatUnsupportedError: if the server rejects this way of asking for JSON.
            ToolsUnsupportedError: if the server rejects the tools that are offered.
            ChatError: for any other failure; it names the LLM and the key's variable.
        """
        mode = mode or self.mode
        key = find_key(self.llm, api_base=self.api_base)
        secrets = (key or "", *secrets_in(self.options))
        litellm = load_litellm()
        arguments = self._arguments(request, mode)
        left = request.seconds_left
        if left is not None and left <= 0:  # the import above may have taken it
            raise ChatError(f"{self.llm}: nothing was sent: the time limit ended while the client was loaded")
        timeout = min(self.timeout, _LONGEST_TIMEOUT)
        seconds = timeout if left is None else min(timeout, left)
        started = perf_counter()

        def ask() -> ChatReply:
            response = litellm.completion(
                model=self.llm,
                messages=[sent_message(m, marks=known(self.llm).marks) for m in request.messages],
                api_base=self.api_base,
                timeout=timeout,
                drop_params=True,  # what the LLM does not accept is omitted; _effective() reports it
                **{"api_key": key, **arguments},
            )
            return self._reply(request, response, arguments, mode, perf_counter() - started)

        try:
            return cleaned(within(seconds, ask), secrets)
        except Exception as error:  # litellm raises its own errors, its clients' and plain built-in ones
            failure = classify(
                error,
                llm=self.llm,
                api_base=self.api_base,
                key_variables=known(self.llm).keys,
                secrets=secrets,
                offers_tools=bool(request.tools),
                options=self.options,
            )
            if isinstance(failure, UnreadableReplyError):
                return ChatReply(
                    text="",
                    finish_reason=UNREADABLE,
                    usage=self._lost(request, timed_out=0),
                    seconds=perf_counter() - started,
                    parameters=self._effective(arguments, mode),
                )
            if isinstance(error, TimeoutError) or type(error).__name__ == "Timeout":
                failure.lost = self._lost(request, timed_out=1)
            raise failure from None

    def _lost(self, request: ChatRequest, *, timed_out: int) -> Usage:
        price = self.price or listed_price(self.llm, api_base=self.api_base)
        return lost_usage(request, llm=self.llm, price=price, timed_out=timed_out)

    def _options(self) -> dict[str, Any]:
        return {**known(self.llm).defaults, **self.options}

    def _arguments(self, request: ChatRequest, mode: Mode) -> dict[str, Any]:
        provider = known(self.llm)
        arguments = self._options()
        if provider.openai_client:
            arguments["max_retries"] = 0  # the client would silently retry twice
        if provider_of(self.llm) == "openai" and self.api_base is None:
            # Requests that begin alike go to the machine that has kept the beginning.
            beginning = request.messages[0].content.encode()
            arguments["prompt_cache_key"] = sha256(beginning).hexdigest()[:16]
        if self.effort is not None:
            arguments["reasoning_effort"] = self.effort
            if provider.effort == "allowed":
                arguments["allowed_openai_params"] = ["reasoning_effort"]
        if request.reply_schema is not None and mode in ("bounded_schema", "json_schema"):
            schema = (
                request.reply_schema if mode == "bounded_schema" else without_limits(request.reply_schema)
            )
            arguments["response_format"] = {
                "type": "json_schema",
                "json_schema": {"name": "reply", "strict": True, "schema": schema},
            }
        elif request.reply_schema is not None and mode == "json_object":
            arguments["response_format"] = {"type": "json_object"}
        if request.tools:
            arguments["tools"] = [without_limits(sent_tool(tool)) for tool in request.tools]
            # Given tools, litellm imports its MCP gateway, whose packages are not among litellm's own
            # requirements. It removes this argument before sending.
            arguments["_skip_mcp_handler"] = True
        if request.max_tokens:
            arguments["max_tokens"] = max(request.max_tokens, arguments.get("max_tokens") or 0)
        return arguments

    def _reply(
        self, request: ChatRequest, response: Any, arguments: Mapping[str, Any], mode: Mode, seconds: float
    ) -> ChatReply:
        choice = response.choices[0]
        refusal = _refusal(choice.message)
        refused = bool(refusal) and not choice.message.content
        text = storable(choice.message.content or refusal)
        echo = known(self.llm).echo
        calls = calls_in(choice.message, echo)
        reported = (getattr(response, "_hidden_params", None) or {}).get("response_cost")
        return ChatReply(
            text=text,
            tool_calls=calls,
            echo=echo_of(choice.message, echo) if calls else {},
            reasoning=storable(getattr(choice.message, "reasoning_content", None) or ""),
            finish_reason="refusal" if refused else choice.finish_reason or "",
            usage=usage_of(
                getattr(response, "usage", None),
                llm=self.llm,
                request=request,
                text="".join((text, *(call.arguments for call in calls))),
                price=self.price,
                reported_cost=self._believed(reported),
            ),
            seconds=seconds,
            parameters=self._effective(arguments, mode),
        )

    def _believed(self, cost: float | None) -> float | None:
        """Reported cost if it can be true: another server under a listed name has its own prices."""
        if known(self.llm).local:
            return cost
        return cost if cost and self.api_base is None else None

    def _effective(self, arguments: Mapping[str, Any], mode: Mode) -> dict[str, Any]:
        """What was sent in addition to the messages; ``dropped`` lists what this LLM does not accept."""
        dropped = dropped_parameters(self.llm, arguments)
        own_names = {"reasoning_effort": "effort"}
        omitted = {own_names.get(name, name) for name in dropped}
        effective = {k: v for k, v in self.parameters.items() if k not in omitted}
        effective["mode"] = mode if "response_format" in arguments else "prompt"
        if "tools" in arguments:
            effective["tools"] = [tool["function"]["name"] for tool in arguments["tools"]]
        if "max_tokens" in effective:
            effective["max_tokens"] = arguments["max_tokens"]
        return {**effective, "dropped": sorted(omitted)} if omitted else effective


def _without_tools(request: ChatRequest) -> ChatRequest:
    return request.model_copy(update={"tools": ()})


def _refusal(message: Any) -> str:
    """Why the LLM declined, if the provider reports that in a separate field."""
    fields = getattr(message, "provider_specific_fields", None) or {}
    return str(getattr(message, "refusal", None) or fields.get("refusal") or "")
