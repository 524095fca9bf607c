"""The only place that imports litellm, and only when an LLM is used: the import takes seconds."""

import json
import os
import warnings
from collections.abc import Mapping, Sequence
from functools import cache
from inspect import signature
from math import isfinite
from typing import Any

from falsifier.errors import ChatError, ChatSetupError, did_you_mean
from falsifier.llm.messages import Message, Tool, ToolCall
from falsifier.llm.providers import PROVIDERS, known, provider_of
from falsifier.llm.transport import guarded_client
from falsifier.llm.usage import Price

# What litellm would do on import or first use, and the variables that prevent it.
_ENVIRONMENT = {
    "LITELLM_LOCAL_MODEL_COST_MAP": "True",  # fetch a price list
    "LITELLM_LOCAL_ANTHROPIC_BETA_HEADERS": "True",  # fetch a list of headers
    "LITELLM_MODE": "PRODUCTION",  # read a .env file
}
# Providers that pass options on to servers of all kinds.
_ROUTERS = frozenset({"openrouter", "huggingface"})
# Parameters that litellm drops for LLMs that do not accept them.
_DROPPABLE = frozenset(
    {"temperature", "top_p", "seed", "max_tokens", "reasoning_effort", "stop", "presence_penalty",
     "frequency_penalty"}
)  # fmt: skip


@cache
def load_litellm() -> Any:
    """Import litellm without its network access, its .env file and its messages.

    Raises:
        ChatError: if it cannot be imported.
    """
    os.environ.update(_ENVIRONMENT)
    try:
        import litellm
    except ImportError as error:
        raise ChatError(f"litellm cannot be imported ({error}): pip install litellm") from None
    litellm.suppress_debug_info = True
    # litellm's own types, and replies of another form, cause these warnings of pydantic; the user can do
    # nothing about the first, and is told of the second.
    for text in (".*`ReadOnly` qualifier", "Pydantic serializer warnings"):
        warnings.filterwarnings("ignore", message=text, category=UserWarning)
    _guard(litellm)
    return litellm


def _guard(litellm: Any) -> None:
    """Let litellm make its HTTP clients so that requests can be limited and cut.

    It takes a client for OpenAI's library only; its own handler makes one where it is first used.
    """
    from litellm.llms.custom_httpx.http_handler import HTTPHandler, get_ssl_configuration

    litellm.client_session = guarded_client(verify=get_ssl_configuration())
    HTTPHandler.create_client = lambda self: guarded_client(verify=get_ssl_configuration(self.ssl_verify))


def check_name(llm: str) -> None:
    """Reject a name with an unknown provider; for the listed providers this does not import litellm.

    Raises:
        ChatSetupError: stating the expected form.
    """
    provider, _, name = llm.partition("/")
    if name.strip("/ ") and (provider in PROVIDERS or _knows(llm)):
        return
    if provider in PROVIDERS:
        raise ChatSetupError(
            f"{llm!r} names a provider, but no model: expected PROVIDER/MODEL such as openai/gpt-5-mini"
        )
    raise ChatSetupError(
        f"{llm!r} does not name a known provider: expected PROVIDER/MODEL such as openai/gpt-5-mini; "
        f"{did_you_mean(provider, PROVIDERS)}"
    )


def listed_price(llm: str, *, api_base: str | None = None) -> Price | None:
    """Price of an LLM in litellm's table; None if it is not listed, or wrongly listed as free.

    Another server under a listed name has its own prices, unless it is the user's own machine.
    """
    if api_base is not None and not known(llm).local:
        return None
    try:
        info = load_litellm().get_model_info(llm)
    except ChatError:
        raise
    except Exception:  # not in the table
        return None
    prompt, completion = info.get("input_cost_per_token"), info.get("output_cost_per_token")
    if prompt is None or completion is None or (not prompt and not completion and not known(llm).local):
        return None
    return Price(1e6 * prompt, 1e6 * completion)


def may_take_tools(llm: str, *, api_base: str | None = None) -> bool:
    """Whether to offer tools: False only if litellm lists the LLM as one without tool support.

    For the user's own server the answer is always True: only a request can show what it supports.
    """
    if api_base is not None or known(llm).local:
        return True
    litellm = load_litellm()
    try:
        litellm.get_model_info(llm)
    except Exception:  # not in the table
        return True
    return bool(litellm.supports_function_calling(llm))


def check_options(llm: str, options: Mapping[str, Any], *, api_base: str | None = None) -> None:
    """Reject options that the provider does not have.

    What a server of the user's own, a router or an unlisted provider takes is not known: its options are sent
    as they are.

    Raises:
        ChatSetupError: naming the option.
    """
    if "timeout" in options:
        raise ChatSetupError("timeout: use --llm-option timeout=SECONDS, which also limits slow replies")
    provider = provider_of(llm)
    is_own = api_base is not None or known(llm).local or not known(llm).keys or provider in _ROUTERS
    if not options or is_own:
        return
    taken = _options_of(llm)
    for name in options:
        if name not in taken:
            raise ChatSetupError(
                f"--llm-option {name}: {provider} has no such option; {did_you_mean(name, taken)}. What "
                "litellm does not know can be sent in Python as options={'extra_body': {...}}"
            )


def _options_of(llm: str) -> set[str]:
    """Names of what litellm takes for an LLM: OpenAI's parameters, the provider's and its own."""
    litellm = load_litellm()
    from litellm.types.utils import all_litellm_params
    from litellm.utils import ProviderConfigManager

    name, provider, *_ = litellm.get_llm_provider(llm)
    taken = {*signature(litellm.completion).parameters, *all_litellm_params, "extra_body", "max_retries"}
    taken |= set(litellm.get_supported_openai_params(model=name, custom_llm_provider=provider) or ())
    config = ProviderConfigManager.get_provider_chat_config(name, litellm.LlmProviders(provider))
    for kind in type(config).__mro__:
        taken |= {key for key in getattr(kind, "__annotations__", {}) if key.islower() and key[0] != "_"}
    return taken - {"kwargs", "self"}


def dropped_parameters(llm: str, arguments: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the arguments that litellm omits because the LLM does not accept them."""
    allowed = set(arguments.get("allowed_openai_params", ()))
    stated = {k: v for k, v in arguments.items() if k in _DROPPABLE and k not in allowed}
    effort = {k: v for k, v in stated.items() if k == "reasoning_effort"}
    return tuple(name for name in stated if not _takes(llm, {**effort, name: stated[name]}))


def _knows(llm: str) -> bool:
    litellm = load_litellm()
    try:
        litellm.get_llm_provider(llm)
    except Exception:  # litellm raises various exceptions for unknown names
        return False
    return True


def _takes(llm: str, arguments: Mapping[str, Any]) -> bool:
    litellm = load_litellm()
    try:
        name, provider, *_ = litellm.get_llm_provider(llm)
        litellm.utils.get_optional_params(
            model=name, custom_llm_provider=provider, drop_params=False, **arguments
        )
    except litellm.UnsupportedParamsError:
        return False
    except Exception:  # unknown here; the request itself will show it
        return True
    return True


def sent_message(message: Message, *, marks: bool = False) -> dict[str, Any]:
    """Message with OpenAI's field names; an assistant's message that only makes calls has no content.

    Args:
        message: what is sent.
        marks: whether to mark what the next question will begin with, too.
    """
    sent: dict[str, Any] = {"role": message.role, "content": message.content}
    if marks and message.stable:
        kept, rest = message.content[: message.stable], message.content[message.stable :]
        sent["content"] = [
            {"type": "text", "text": kept, "cache_control": {"type": "ephemeral"}},
            *([{"type": "text", "text": rest}] if rest else []),
        ]
    if message.tool_call_id:
        sent["tool_call_id"] = message.tool_call_id
    if message.tool_calls:
        sent |= {
            "content": message.content or None,
            "tool_calls": [_sent_call(c) for c in message.tool_calls],
        }
    return {**sent, **message.echo}


def sent_tool(tool: Tool) -> dict[str, Any]:
    """Tool with OpenAI's field names."""
    return {"type": "function", "function": tool.model_dump()}


def calls_in(message: Any, echo: Sequence[str]) -> tuple[ToolCall, ...]:
    """Calls in a reply, in order.

    Args:
        message: as the client library returns it.
        echo: fields of a call that must be sent back to the provider.
    """
    return tuple(
        ToolCall(
            id=call.id or f"call-{number}",
            name=call.function.name or "",
            arguments=storable(call.function.arguments or ""),
            echo=echo_of(call, echo),
        )
        for number, call in enumerate(getattr(message, "tool_calls", None) or (), start=1)
    )


def echo_of(source: Any, names: Sequence[str]) -> dict[str, Any]:
    """The non-empty fields of a reply, or of a call in it, that must be sent back to the provider."""
    found = {name: getattr(source, name, None) for name in names}
    return {name: value for name, value in found.items() if value}


def storable(text: str) -> str:
    """Text without unpaired surrogates, which UTF-8 cannot encode: the journal could not store them."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _sent_call(call: ToolCall) -> dict[str, Any]:
    function = {"name": call.name, "arguments": _as_servers_take(call.arguments)}
    return {"id": call.id, "type": "function", "function": function, **call.echo}


def _as_servers_take(arguments: str) -> str:
    """Arguments of an earlier call; empty ones if they are not JSON, because servers reject the conversation.

    The answer to the call says what was wrong with them.
    """
    try:
        json.loads(arguments, parse_float=_finite, parse_constant=_finite)
    except (ValueError, RecursionError):
        return "{}"
    return arguments


def _finite(number: str) -> float:
    if not isfinite(float(number)):
        raise ValueError(f"{number} is not finite")
    return float(number)
