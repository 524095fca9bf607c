"""One request to an LLM behind litellm: sent once, answered, or failed with one of our own errors."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

from falsifier.core.secrets import redact, secrets_in, without_secrets
from falsifier.llm.failures import classify
from falsifier.llm.litellm_import import dropped_parameters, load_litellm
from falsifier.llm.messages import MODES, ChatReply, ChatRequest, Mode
from falsifier.llm.providers import find_key, known
from falsifier.llm.usage import Price, usage_of
from falsifier.llm.wire import calls_in, echo_of, sent_message, sent_tool, storable

# Reasoning models may think for minutes; seconds.
DEFAULT_TIMEOUT = 600.0


@dataclass(frozen=True)
class LiteLLMChat:
    """An LLM behind any provider that litellm speaks to.

    Attributes:
        llm: litellm's name, e.g. ``openai/gpt-5-mini``.
        effort: reasoning effort, ``low``, ``medium`` or ``high``; None: the LLM's own.
        api_base: address of the server; None: the provider's own.
        options: further parameters of litellm's ``completion``, passed as they are.
        timeout: seconds to wait for an answer.
        price: the user's own price; None: litellm's table.
        mode: how replies of a schema are asked for.
    """

    llm: str
    effort: str | None = None
    api_base: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    timeout: float = DEFAULT_TIMEOUT
    price: Price | None = None
    mode: Mode = MODES[0]

    @property
    def parameters(self) -> Mapping[str, Any]:
        """What is sent beside the messages, without secrets."""
        stated = {"effort": self.effort, "api_base": self.api_base and redact(self.api_base)}
        return {**{k: v for k, v in stated.items() if v is not None}, **without_secrets(self._options())}

    def complete(self, request: ChatRequest) -> ChatReply:
        """Send one request.

        Raises:
            TransientChatError: for what may be gone the next time.
            FormatUnsupportedError: when the server refuses this way of asking for JSON.
            ToolsUnsupportedError: when the server refuses the tools that are offered.
            ChatError: for everything else, naming the LLM and the key's variable.
        """
        key = find_key(self.llm, api_base=self.api_base)
        litellm = load_litellm()
        arguments = self._arguments(request)
        started = perf_counter()
        try:
            response = litellm.completion(
                model=self.llm,
                messages=[sent_message(m) for m in request.messages],
                api_base=self.api_base,
                timeout=self.timeout,
                drop_params=True,
                **{"api_key": key, **arguments},
            )
            return self._reply(request, response, arguments, perf_counter() - started)
        except Exception as error:  # litellm raises its own, its clients' and bare built-in errors alike
            raise classify(
                error,
                llm=self.llm,
                api_base=self.api_base,
                key_variables=known(self.llm).keys,
                secrets=(key or "", *secrets_in(self.options)),
                offers_tools=bool(request.tools),
            ) from None

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Keep nothing."""

    def _options(self) -> dict[str, Any]:
        return {**known(self.llm).defaults, **self.options}

    def _arguments(self, request: ChatRequest) -> dict[str, Any]:
        provider = known(self.llm)
        arguments = self._options()
        if provider.openai_client:
            arguments["max_retries"] = 0  # the client would retry twice without saying so
        if self.effort is not None:
            arguments["reasoning_effort"] = self.effort
            if provider.effort == "allowed":
                arguments["allowed_openai_params"] = ["reasoning_effort"]
        if request.reply_schema is not None and self.mode == "json_schema":
            arguments["response_format"] = {
                "type": "json_schema",
                "json_schema": {"name": "reply", "strict": True, "schema": request.reply_schema},
            }
        elif request.reply_schema is not None and self.mode == "json_object":
            arguments["response_format"] = {"type": "json_object"}
        if request.tools:
            arguments["tools"] = [sent_tool(tool) for tool in request.tools]
            # With tools litellm imports its gateway for MCP servers, whose packages are not among its own
            # requirements; it pops this again before anything is sent.
            arguments["_skip_mcp_handler"] = True
        if request.room > 1 and "max_tokens" in arguments:
            arguments["max_tokens"] *= request.room
        return arguments

    def _reply(
        self, request: ChatRequest, response: Any, arguments: Mapping[str, Any], seconds: float
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
                request=request,
                text="".join((text, *(call.arguments for call in calls))),
                price=self.price,
                reported_cost=self._believed(reported),
            ),
            seconds=seconds,
            parameters=self._effective(arguments),
        )

    def _believed(self, cost: float | None) -> float | None:
        """Reported cost where it can be true: another server under a known name has prices of its own."""
        if known(self.llm).local:
            return cost
        return cost if cost and self.api_base is None else None

    def _effective(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """What was sent beside the messages; ``dropped`` names what this LLM does not take."""
        dropped = dropped_parameters(self.llm, arguments)
        own_names = {"reasoning_effort": "effort"}
        omitted = {own_names.get(name, name) for name in dropped}
        effective = {k: v for k, v in self.parameters.items() if k not in omitted}
        effective["mode"] = arguments.get("response_format", {}).get("type", "prompt")
        if "tools" in arguments:
            effective["tools"] = [tool["function"]["name"] for tool in arguments["tools"]]
        if "max_tokens" in effective:
            effective["max_tokens"] = arguments["max_tokens"]
        return {**effective, "dropped": sorted(omitted)} if omitted else effective


def _refusal(message: Any) -> str:
    """Why the LLM declines, where it says so in a field of its own."""
    fields = getattr(message, "provider_specific_fields", None) or {}
    return str(getattr(message, "refusal", None) or fields.get("refusal") or "")
