"""From an LLM's name to a chat that retries, adapts to the server and never pays twice for one question."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from falsifier.core.files import cache_directory
from falsifier.errors import ChatSetupError
from falsifier.llm.client import DEFAULT_ATTEMPTS, DEFAULT_TIMEOUT, LiteLLMChat
from falsifier.llm.litellm_adapter import check_name, check_options
from falsifier.llm.messages import Chat
from falsifier.llm.model_file import check_model_file, is_model_file, served
from falsifier.llm.providers import check_address, find_key, first_mode
from falsifier.llm.usage import Price


def preflight(llm: str, *, api_base: str | None = None, options: Mapping[str, Any] | None = None) -> None:
    """Check an LLM's name, address, key and options without sending anything.

    Raises:
        ChatError: saying what to set or change.
    """
    if is_model_file(llm):
        check_model_file(llm)
        if api_base is not None:
            raise ChatSetupError(f"--llm {llm}: a model file has a server of its own; drop --api-base")
        return
    check_name(llm)
    check_address(llm, api_base)
    find_key(llm, api_base=api_base)
    check_options(llm, options or {}, api_base=api_base)


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
        api_base: address of the server, if it is not the provider's own.
        options: further parameters of litellm's ``completion``.
        price: what the LLM costs; None: litellm's table.
        timeout: seconds to wait for one reply.
        attempts: maximum number of requests per reply if failures are temporary.
        cache: directory of stored replies; None: no cache.

    Raises:
        ChatError: for an unknown provider, an unknown option, a missing key, or an address with a password.
    """
    preflight(llm, api_base=api_base, options=options)
    own = served(llm) if is_model_file(llm) else None
    if own is not None:
        llm, api_base, price = own.name, own.address, price or Price(0.0, 0.0)
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


def default_cache_directory() -> Path:
    """Directory of stored replies: ``replies`` in this tool's cache directory."""
    return cache_directory() / "replies"
