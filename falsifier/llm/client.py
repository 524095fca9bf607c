"""The one door to litellm: one request, sent once, answered or failed with one of our own errors."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from time import perf_counter
from typing import Any

from falsifier.errors import ChatError
from falsifier.llm.failures import classify, redact
from falsifier.llm.messages import ChatReply, ChatRequest
from falsifier.llm.modes import MODES, Mode
from falsifier.llm.providers import find_key, known, provider_of
from falsifier.llm.usage import Price, usage_of

# Reasoning models may think for minutes; seconds.
DEFAULT_TIMEOUT = 600.0


@dataclass(frozen=True)
class LiteLLMChat:
    """A model behind any provider that litellm speaks to.

    Attributes:
        model: litellm's name, e.g. ``openai/gpt-5-mini``.
        effort: reasoning effort, ``low``, ``medium`` or ``high``; None: the model's own.
        api_base: address of the server; None: the provider's own.
        options: further parameters of litellm's ``completion``, passed as they are.
        timeout: seconds to wait for an answer.
        price: the user's own price; None: litellm's table.
        mode: how replies of a schema are asked for.
    """

    model: str
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
        options = {k: v for k, v in self.options.items() if k not in _SECRET_OPTIONS}
        return {**{k: v for k, v in stated.items() if v is not None}, **options}

    def complete(self, request: ChatRequest) -> ChatReply:
        """Send one request.

        Raises:
            TransientChatError: for what may be gone the next time.
            FormatUnsupportedError: when the server refuses this way of asking for JSON.
            ChatError: for everything else, naming the model and the key's variable.
        """
        key = find_key(self.model, api_base=self.api_base)
        litellm = load_litellm()
        arguments = self._arguments(request)
        started = perf_counter()
        try:
            response = litellm.completion(
                model=self.model,
                messages=[m.model_dump() for m in request.messages],
                api_base=self.api_base,
                api_key=key,
                timeout=self.timeout,
                drop_params=True,
                **arguments,
            )
            return self._reply(request, response, arguments, perf_counter() - started)
        except Exception as error:  # litellm raises its own, its clients' and bare built-in errors alike
            variables = known(self.model).keys
            raise classify(
                error,
                model=self.model,
                api_base=self.api_base,
                key_variables=variables,
                secrets=(key or "",),
            ) from None

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Keep nothing."""

    def _arguments(self, request: ChatRequest) -> dict[str, Any]:
        provider = known(self.model)
        arguments: dict[str, Any] = dict(self.options)
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
        if request.room > 1 and "max_tokens" in arguments:
            arguments["max_tokens"] *= request.room
        return arguments

    def _reply(
        self, request: ChatRequest, response: Any, arguments: Mapping[str, Any], seconds: float
    ) -> ChatReply:
        choice = response.choices[0]
        text = choice.message.content or getattr(choice.message, "refusal", None) or ""
        refused = not choice.message.content and bool(text)
        reported = (getattr(response, "_hidden_params", None) or {}).get("response_cost")
        return ChatReply(
            text=text,
            reasoning=getattr(choice.message, "reasoning_content", None) or "",
            finish_reason="refusal" if refused else choice.finish_reason or "",
            usage=usage_of(
                getattr(response, "usage", None),
                request=request,
                text=text,
                price=self.price,
                reported_cost=self._believed(reported),
            ),
            seconds=seconds,
            parameters=self._effective(arguments),
        )

    def _believed(self, cost: float | None) -> float | None:
        """Reported cost where it can be true: a server of the user's own bears a known name at no price."""
        if known(self.model).local:
            return cost
        return cost if cost and self.api_base is None else None

    def _effective(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """What was sent beside the messages; parameters that this model does not take are named."""
        taken = set(supported_parameters(self.model)) | set(arguments.get("allowed_openai_params", ()))
        wanted = [k for k in arguments if k in _STANDARD and k not in taken]
        effective = {k: v for k, v in self.parameters.items() if k not in wanted}
        if "reasoning_effort" in wanted:
            effective.pop("effort", None)
        response_format = arguments.get("response_format")
        effective["mode"] = response_format["type"] if response_format else "prompt"
        return {**effective, "dropped": wanted} if wanted else effective


_SECRET_OPTIONS = frozenset({"api_key", "extra_headers", "headers"})
_STANDARD = frozenset(
    {"temperature", "top_p", "seed", "max_tokens", "reasoning_effort", "stop", "presence_penalty",
     "frequency_penalty", "response_format"}
)  # fmt: skip


@cache
def load_litellm() -> Any:
    """Import litellm, which takes seconds, without its network access, its .env file and its prints.

    Raises:
        ChatError: when it is not installed.
    """
    os.environ["LITELLM_LOCAL_MODEL_COST_MAP"] = "True"  # or it fetches a price list from the network
    os.environ["LITELLM_MODE"] = "PRODUCTION"  # or it reads a .env file
    try:
        import litellm
    except ImportError as error:
        raise ChatError(f"litellm cannot be imported ({error}): pip install litellm") from None
    litellm.suppress_debug_info = True
    litellm.telemetry = False
    return litellm


@cache
def supported_parameters(model: str) -> tuple[str, ...]:
    """Parameters that litellm passes on for this model."""
    litellm = load_litellm()
    try:
        found = litellm.get_supported_openai_params(model=model, custom_llm_provider=provider_of(model))
    except Exception:  # an unlisted model; then nothing is known to be dropped
        return tuple(_STANDARD)
    return tuple(found or _STANDARD)
