"""What is known about each provider before anything is sent: its key, its server, what it accepts."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from types import MappingProxyType
from typing import Any
from urllib.parse import urlsplit

from falsifier.core.secrets import holds_credentials, without_credentials
from falsifier.errors import ChatSetupError, setting, written
from falsifier.llm.messages import Mode


@dataclass(frozen=True, slots=True)
class Provider:
    """One provider; the first part of an LLM's name identifies it."""

    # Environment variables that may contain its key, the usual one first; empty: none is needed.
    keys: tuple[str, ...] = ()
    local: bool = False  # runs on the user's own machine, so a price of zero is correct
    address: str = ""  # default address of its server; litellm has none for some
    own: bool = False  # a server of the user's own, of which nobody else knows the address
    start: str = ""  # command that starts its server, for messages
    openai_client: bool = False  # served through the OpenAI client, which silently retries by default
    defaults: Mapping[str, Any] = field(default_factory=dict)  # sent unless the user states them
    names_effort: bool = False  # whether litellm passes an effort only if the parameter is named
    marks: bool = False  # whether it keeps only what is marked of a prompt
    limits: bool = False  # whether schemas may state numbers of items and ranges of numbers
    routes: bool = False  # whether it passes options on to servers of all kinds
    # Whether gpt-oss, constrained to a grammar, returns empty or garbled replies (ollama#11691, ollama#12470,
    # lmstudio-bug-tracker#1555).
    garbles_gpt_oss: bool = False


# Ollama silently cuts off the beginning of a prompt that exceeds its context. Its default context is shorter
# than most prompts with a history.
_OLLAMA = Provider(
    local=True,
    address="http://localhost:11434",
    start="ollama serve",
    defaults=MappingProxyType({"num_ctx": 32_768}),
    limits=True,
    garbles_gpt_oss=True,
)

PROVIDERS: Mapping[str, Provider] = MappingProxyType(
    {
        "openai": Provider(("OPENAI_API_KEY",), openai_client=True, limits=True),
        "azure": Provider(("AZURE_API_KEY",), openai_client=True),
        "anthropic": Provider(("ANTHROPIC_API_KEY",), marks=True),
        "gemini": Provider(("GEMINI_API_KEY", "GOOGLE_API_KEY")),
        "huggingface": Provider(("HF_TOKEN", "HUGGINGFACE_API_KEY"), names_effort=True, routes=True),
        "mistral": Provider(("MISTRAL_API_KEY",)),
        "groq": Provider(("GROQ_API_KEY",)),
        "deepseek": Provider(("DEEPSEEK_API_KEY",)),
        "openrouter": Provider(("OPENROUTER_API_KEY",), routes=True),
        "together_ai": Provider(("TOGETHERAI_API_KEY", "TOGETHER_API_KEY")),
        "xai": Provider(("XAI_API_KEY",)),
        "ollama": _OLLAMA,
        "ollama_chat": _OLLAMA,
        "lm_studio": Provider(
            local=True,
            address="http://localhost:1234/v1",
            start="lms server start",
            openai_client=True,
            names_effort=True,
            limits=True,
            garbles_gpt_oss=True,
        ),
        "hosted_vllm": Provider(own=True, start="vllm serve MODEL", limits=True),
        "custom_openai": Provider(("CUSTOM_OPENAI_API_KEY",), own=True, openai_client=True),
        "litellm_proxy": Provider(("LITELLM_PROXY_API_KEY",), own=True, openai_client=True),
        "xinference": Provider(("XINFERENCE_API_KEY",), own=True, openai_client=True),
        "llamafile": Provider(
            local=True,
            address="http://127.0.0.1:8080/v1",
            start="MODEL.llamafile --server",
            openai_client=True,
            limits=True,
        ),
    }
)

# Sent if an OpenAI-compatible server needs no key, because its client insists on one.
NO_KEY = "none"
# Options of litellm that take the place of the address or of the provider in the name.
_OF_SERVERS = frozenset({"base_url", "api_base", "custom_llm_provider"})
# What each request states by itself.
_OF_REQUESTS = frozenset({"model", "messages", "drop_params"})
_ADDRESS_FORM = "http://HOST:PORT/v1 or https://..."


def provider_of(llm: str) -> str:
    """First part of an LLM's name."""
    return llm.split("/", 1)[0]


def known(llm: str) -> Provider:
    """What is known about an LLM's provider; the defaults for an unlisted one."""
    return PROVIDERS.get(provider_of(llm), Provider())


def check_address(llm: str, api_base: str | None) -> None:
    """Refuse an address that is none, or that contains a user name, a password or a key.

    Addresses are recorded, printed in commands and seen by whoever lists the processes of the machine.

    Raises:
        ChatSetupError: saying how to state it; without the address if that contains a password.
    """
    if api_base is None:
        return
    if holds_credentials(api_base):
        raise ChatSetupError(
            f"{setting('api_base')}: an address with a user name, a password or a key would be recorded; "
            "drop it, and put the whole address into the environment variable "
            f"{_address_variables(llm)[-1]}"
        )
    if not _is_address(api_base):
        raise ChatSetupError(f"{setting('api_base')} {api_base}: expected {_ADDRESS_FORM}")


def _is_address(text: str) -> bool:
    try:
        parts = urlsplit(text)
        is_whole = text.split() == [text]  # a blank is none of its characters
        return is_whole and parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        return False


def check_option_values(options: Mapping[str, Any]) -> None:
    """Refuse other servers and prompts, numbers no request can contain, impossible limits of tokens.

    Raises:
        ChatSetupError: naming the option.
    """
    for name, value in options.items():
        option = written(f"--llm-option {name}", name)
        if name in _OF_SERVERS:  # prompts and the key would go to another one than is told
            raise ChatSetupError(
                f"{option}: state the address of a server as {setting('api_base')}, and the provider as the "
                "first part of the name"
            )
        if name in _OF_REQUESTS:
            raise ChatSetupError(f"{option}: every request states it by itself; leave it out")
        if isinstance(value, float) and not isfinite(value):
            raise ChatSetupError(f"{option}: expected a finite number, got {value}")
        if name in ("max_tokens", "max_completion_tokens") and (type(value) is not int or value < 1):
            raise ChatSetupError(f"{option}: expected an integer from 1 on, got {value!r}")


def find_key(llm: str, *, api_base: str | None = None) -> str | None:
    """Key for an LLM from the environment.

    Returns:
        The key; a placeholder for the user's own server without a key; None if none is needed.

    Raises:
        ChatSetupError: naming the variable to set.
    """
    provider = known(llm)
    if variable := key_variable(llm):
        return _sendable(variable)
    if provider.openai_client and (stated_address(llm, api_base) or provider.local):
        return NO_KEY
    if provider.keys and api_base is None:
        raise ChatSetupError(f"{llm}: no API key: set {' or '.join(provider.keys)} in the environment")
    return None


def _sendable(variable: str) -> str:
    """The key in a variable; ChatSetupError if no HTTP header can contain it, as with typographic quotes."""
    key = os.environ[variable].strip()
    for position, character in enumerate(key, start=1):
        if not " " <= character <= "~":
            raise ChatSetupError(
                f"{variable} in the environment: character {position} of {len(key)} ({character!r}) cannot "
                "be part of a key; copy the key again"
            )
    return key


def key_variable(llm: str) -> str:
    """Environment variable that contains a key for this LLM; empty if none does."""
    return next((name for name in key_variables(llm) if os.environ.get(name, "").strip()), "")


def key_variables(llm: str) -> tuple[str, ...]:
    """Environment variables that may contain a key; that of an unlisted provider has usually this name."""
    return known(llm).keys or (f"{provider_of(llm).upper()}_API_KEY",)


def unset_key(llm: str) -> str:
    """What to do if a server wants a key, and none is known."""
    return f"set {' or '.join(key_variables(llm))} in the environment, to any text if the server needs none"


def stated_address(llm: str, api_base: str | None) -> str | None:
    """Address of an LLM's server as the user states it, here or in the environment; None: the provider's.

    If both name the same server, that of the environment, which may have a password.

    Raises:
        ChatSetupError: if that of the environment cannot be used; naming the variable.
    """
    # A model file has a server of its own, and an address of Azure is the provider's own: there is no other.
    if provider_of(llm) in ("", "azure"):
        return api_base
    variables = (name for name in _address_variables(llm) if os.environ.get(name, "").strip())
    variable = next(variables, "")
    address = os.environ.get(variable, "").strip()
    if api_base and without_credentials(address) != api_base:
        return api_base
    if address and (not _is_address(address) or holds_credentials(without_credentials(address))):
        raise ChatSetupError(
            f"{variable} in the environment: expected {_ADDRESS_FORM}, "
            "with / ? # in a password as %2F %3F %23"
        )
    return address or None


def check_recorded(llm: str, api_base: str | None) -> None:
    """Refuse to ask another server than the settings' or their provider's own; ChatSetupError naming both."""
    if api_base is None and (now := stated_address(llm, None)):
        variables = " and ".join(_address_variables(llm))
        raise ChatSetupError(
            f"{llm}: the provider's own server was asked so far, and the environment names "
            f"{without_credentials(now)} now: unset {variables}, or start a new run"
        )


def server_address(llm: str, api_base: str | None) -> str | None:
    """Address of an LLM's server: as stated, or the provider's default; None if only litellm knows it.

    Raises:
        ChatSetupError: if it is a server of the user's own, and nothing says where.
    """
    address = stated_address(llm, api_base) or known(llm).address
    if known(llm).own and not address:
        variable = _address_variables(llm)[-1]
        raise ChatSetupError(f"{llm}: where is the server? state {setting('api_base')}, or set {variable}")
    return address or None


def _address_variables(llm: str) -> tuple[str, ...]:
    """Environment variables in which litellm looks for a server's address, the first one first."""
    # A campaign's settings hold for several LLMs and are made without a name.
    provider = "OLLAMA" if known(llm) is _OLLAMA else provider_of(llm).upper() or "OPENAI"
    others = (f"{provider}_BASE_URL",) if provider in ("OPENAI", "ANTHROPIC") else ()
    return (*others, f"{provider}_API_BASE")


def first_mode(llm: str) -> Mode:
    """First way of asking this LLM for JSON."""
    if known(llm).garbles_gpt_oss and "gpt-oss" in llm:
        return "prompt"
    return "bounded_schema" if known(llm).limits else "json_schema"
