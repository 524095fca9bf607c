"""From the name of an LLM to a chat with it, after its key and its options were checked."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from falsifier.core.arguments import instance
from falsifier.errors import ChatSetupError, setting
from falsifier.llm import Effort, litellm_adapter
from falsifier.llm.client import DEFAULT_ATTEMPTS, DEFAULT_TIMEOUT, LiteLLMChat
from falsifier.llm.messages import Chat
from falsifier.llm.model_file import check_model_file, is_model_file, served
from falsifier.llm.providers import (
    check_address,
    check_option_values,
    find_key,
    first_mode,
    server_address,
    stated_address,
)
from falsifier.llm.usage import Price


def preflight(llm: str, *, api_base: str | None = None, options: Mapping[str, Any] | None = None) -> None:
    """Check an LLM's name, address, key and options, sending nothing; ChatError saying what to change."""
    instance("llm", llm, str, "a name such as openai/gpt-5-mini, or the path of a model file")
    if is_model_file(llm):
        check_model_file(llm)
        if api_base is not None:
            raise ChatSetupError(f"{llm}: a model file has a server of its own; drop {setting('api_base')}")
        return
    name, _, effort = llm.rpartition("@")
    if name and effort in get_args(Effort):  # servers with one model take any name, without the effort
        raise ChatSetupError(f"{llm!r}: state the effort beside the name: {name!r}, effort={effort!r}")
    litellm_adapter.check_name(llm)
    check_address(llm, api_base)
    server_address(llm, api_base)
    find_key(llm, api_base=api_base)
    check_option_values(options or {})
    litellm_adapter.check_options(llm, options or {}, api_base=api_base)


def connect(
    llm: str,
    *,
    effort: str | None = None,
    api_base: str | None = None,
    options: Mapping[str, Any] | None = None,
    price: Price | None = None,
    timeout: float = DEFAULT_TIMEOUT,
    attempts: int = DEFAULT_ATTEMPTS,
    cache: Path | None = None,
) -> Chat:
    """Make a chat with an LLM; nothing is sent yet. The server of a model file is started.

    Args:
        llm: PROVIDER/MODEL as litellm names it, or the path of a model file (GGUF).
        effort: reasoning effort: ``none``, ``minimal``, ``low``, ``medium`` or ``high``; what the LLM does
            not take is left out, and the record says so.
        api_base: address of the server, if it is not the provider's own or that of the environment.
        options: further parameters of litellm's ``completion``.
        price: what the LLM costs; None: litellm's table.
        timeout: seconds to wait for one reply.
        attempts: maximum number of requests per reply if failures are temporary.
        cache: directory of valid replies, one file each, created with the first one; None: none are kept.

    Raises:
        ChatError: for an unknown provider, an unknown option, a missing key, or an address with a password.
    """
    preflight(llm, api_base=api_base, options=options)
    own = served(llm) if is_model_file(llm) else None
    if own is not None:
        llm, api_base, price = own.name, own.address, price or Price(0.0, 0.0)
    api_base = stated_address(llm, api_base)
    return LiteLLMChat(
        llm=llm,
        effort=effort,
        api_base=api_base,
        options=dict(options or {}),
        timeout=timeout,
        price=price,
        mode=first_mode(llm),
        content="" if own is None else own.content,
        attempts=attempts,
        cache=cache,
    )
