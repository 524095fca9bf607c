"""Failures of requests to a language model, classified by what can be done about them."""

import json
import re
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from math import isfinite
from typing import Any
from urllib.parse import urlsplit

from falsifier.core.literals import printable
from falsifier.core.secrets import redact
from falsifier.errors import ChatError
from falsifier.llm.providers import known, server_address
from falsifier.llm.transport import BrokenReplyError, RefusedReplyError

# 200: the body is not JSON, typically an HTML page from a proxy.
_TRANSIENT_STATUS = frozenset({200, 408, 409, 425, 429})
_FORMAT_WORDS = (
    "response_format",
    "json_schema",
    "json_object",
    "structured output",
    "grammar",
    "schema",
    "json mode",
    "response mime type",
    "failed to initialize samplers",  # llama.cpp, if it cannot constrain this LLM in this way
)
_TOOL_WORDS = ("tool", "function call", "function_call")
# Some servers parse what the LLM wrote, and fail if it does not have the required form: two versions of
# llama.cpp, and Groq.
_UNREADABLE_WORDS = (
    "the model produced output that does not match",
    "failed to parse input at pos",
    "failed to generate json",
    "failed to validate json",
    "failed to call a function",
)
_CONTEXT_WORDS = ("contextwindow", "context_length", "maximum context", "context size", "exceed_context")
_QUOTA_WORDS = ("insufficient_quota", "exceeded your current quota", "billing")
# A key that is right may belong to an account that is not.
_ACCOUNT_WORDS = ("organization", "organisation", "project", "verif", "not have access", "region", "country")
_LONGEST_DETAIL = 600
# What the client library puts before the server's own words, several times over.
_FULL_STOP = re.compile(r"(?<!\.)\.$")
_CLASSES = re.compile(r"(?:(?:litellm\.)?\w+(?:Error|Exception|Timeout)(?:: ?| - |$))+")
_LETTERS = re.compile(r"[^\W\d_]{2}")
# The title of a page that a proxy answers with says what the page says.
_TITLE = re.compile(r"<title>([^<]+)</title>", re.IGNORECASE)
_LONGER = (
    "start its server with a longer context (llama.cpp: --ctx-size 32768; vLLM: --max-model-len 32768), or "
)
# Requests to a local server that refuses connections: enough for one that is just starting.
_LOCAL_PATIENCE = 3


class TransientChatError(ChatError):
    """A temporary failure: rate limit, timeout, lost connection, overloaded server.

    Attributes:
        retry_after: seconds that the server asked to wait, or None.
        for_all: whether other requests on the same account should wait too, as after a rate limit.
        patience: maximum number of requests worth sending; None: no limit of its own.
    """

    def __init__(
        self,
        message: str,
        *,
        retry_after: float | None = None,
        for_all: bool = False,
        patience: int | None = None,
    ) -> None:
        self.retry_after = retry_after
        self.for_all = for_all
        self.patience = patience
        super().__init__(message)


class FormatUnsupportedError(ChatError):
    """The server does not accept this way of asking for JSON."""


class ToolsUnsupportedError(ChatError):
    """The server, or the LLM behind it, does not support tools."""


class ContextExceededError(ChatError):
    """The prompt has more tokens than the LLM, or its server as it was started, takes."""


class UnreadableReplyError(ChatError):
    """The LLM answered, but its server could not parse that in the form that was asked for."""


def classify(
    error: Exception,
    *,
    llm: str,
    api_base: str | None,
    key_variables: tuple[str, ...],
    secrets: Iterable[str],
    offers_tools: bool = False,
    options: Iterable[str] = (),
) -> ChatError:
    """Translate an exception raised by a request into an error of this package, without secrets.

    Args:
        error: what the client library raised.
        llm: name of the LLM.
        api_base: address of the server, if stated.
        key_variables: environment variables that may contain the key.
        secrets: texts to remove from the message.
        offers_tools: whether the request offered tools.
        options: names of the options that the user passes on.
    """
    where = f" at {redact(api_base, secrets)}" if api_base else ""
    if isinstance(error, RefusedReplyError):
        return ChatError(f"{llm}{where}: {redact(printable(str(error)), secrets)}")
    status = _status(error)
    text = redact(printable(f"{type(error).__name__}: {error}"), secrets)
    lowered = _beginning(text).lower()
    detail = _beginning(_own_words(text))
    if status is not None and not _LETTERS.search(detail):
        detail = f"the server answers with the HTTP status {status} and without a reason"
    keys = " or ".join(key_variables) or "the API key"
    address = server_address(llm, api_base)
    if _is_refused(error) and _is_this_machine(address):
        command = known(llm).start
        start = f"the server with '{command}'" if command else "the LLM's server"
        return TransientChatError(
            f"{llm}: nothing is listening at {redact(address, secrets)}: start {start}, "
            "or correct --api-base",
            patience=_LOCAL_PATIENCE,
        )
    if isinstance(error, BrokenReplyError):
        return TransientChatError(f"{llm}{where}: {redact(printable(str(error)), secrets)}")
    if status == 403 and any(word in lowered for word in _ACCOUNT_WORDS):
        return ChatError(
            f"{llm}{where}: the account behind {keys} may not use this LLM: have it allowed for the "
            f"organisation or project of the key, or take another LLM or key. {detail}"
        )
    if status == 413:
        return ContextExceededError(
            f"{llm}{where}: the request is larger than the server, or a proxy before it, takes; use a "
            f"plainer prompt variant (--variant), or raise its limit. {detail}"
        )
    if status in (401, 403):
        return ChatError(f"{llm}{where}: the provider rejected the key; check {keys}. {detail}")
    if status in (400, 422, 500) and any(word in lowered for word in _UNREADABLE_WORDS):
        return UnreadableReplyError(f"{llm}{where}: {detail}")
    speaks_of_format = any(word in lowered for word in _FORMAT_WORDS)
    # Some servers report this as 404 (no route with tools) or 500 (started without tool support).
    if (
        offers_tools
        and status in (400, 404, 422, 500, 501)
        and any(word in lowered for word in _TOOL_WORDS)
        and not speaks_of_format
    ):
        return ToolsUnsupportedError(f"{llm}{where}: {detail}")
    refused = next((o for o in options if re.search(rf"\b{re.escape(o.lower())}\b", lowered)), "")
    if status in (400, 422) and refused:
        return ChatError(
            f"{llm}{where}: the server refuses the option {refused}; drop --llm-option {refused}. {detail}"
        )
    if status == 404:
        return ChatError(
            f"{llm}{where}: no such LLM or address; check the LLM's name, --api-base, and whether the "
            f"account behind {keys} may use it. {detail}"
        )
    if "contentpolicy" in lowered or "content_policy" in lowered or "content management policy" in lowered:
        return ChatError(
            f"{llm}{where}: the provider's content filter rejected the prompt; try another LLM or "
            f"--anonymous. {detail}"
        )
    if any(word in lowered for word in _CONTEXT_WORDS):
        is_own = api_base is not None or known(llm).local
        return ContextExceededError(
            f"{llm}{where}: the prompt is too long for this LLM; {_LONGER if is_own else ''}use a plainer "
            f"prompt variant (--variant) or another LLM. The server says: {detail}"
        )
    if status == 429 and any(word in lowered for word in _QUOTA_WORDS):
        return ChatError(f"{llm}{where}: the account behind {keys} has no quota left. {detail}")
    if status in (400, 422, 501) and speaks_of_format:
        return FormatUnsupportedError(f"{llm}{where}: {detail}")
    if status in _TRANSIENT_STATUS or (status or 0) >= 500 or _is_connection(error):
        return TransientChatError(
            f"{llm}{where}: {detail}", retry_after=_retry_after(error), for_all=status == 429
        )
    return ChatError(f"{llm}{where}: {detail}")


def _own_words(text: str) -> str:
    """What the server said, without the classes of the client library's errors, and out of its JSON."""
    said = _CLASSES.sub("", text, count=1).strip() if _CLASSES.match(text) else text
    try:
        told = json.loads(said)["error"]["message"]
    except (ValueError, TypeError, KeyError, RecursionError):
        told = said
    if title := _TITLE.search(said):
        told = title[1]
    return told if isinstance(told, str) and told.strip() else text


def _beginning(text: str) -> str:
    """Beginning of a message in one line, without the stack trace that the client library may append."""
    text = " ".join(text.split("Traceback (most recent call last)")[0].split())
    # Without its full stop, because more follows in most messages.
    return _FULL_STOP.sub("", text) if len(text) <= _LONGEST_DETAIL else f"{text[:_LONGEST_DETAIL]} ..."


def _status(error: Exception) -> int | None:
    status = getattr(error, "status_code", None)
    return int(status) if isinstance(status, int | str) and str(status).isdigit() else None


def _is_connection(error: Exception) -> bool:
    # The client library raises a plain IndexError for a reply without choices.
    return isinstance(error, ConnectionError | TimeoutError | IndexError)


def _is_refused(error: BaseException | None) -> bool:
    """Whether a connection was refused; the client libraries wrap that error several times."""
    while error is not None:
        if isinstance(error, ConnectionRefusedError) or "connection refused" in str(error).lower():
            return True
        error = error.__cause__ or error.__context__
    return False


def _is_this_machine(address: str) -> bool:
    return (urlsplit(address).hostname or "") in ("localhost", "127.0.0.1", "::1", "0.0.0.0")


def _retry_after(error: Exception) -> float | None:
    """Seconds that the server asked to wait, given as a number or as a date; None if it did not say."""
    for holder in (getattr(error, "response", None), error):
        headers = getattr(holder, "headers", None) or getattr(holder, "litellm_response_headers", None) or {}
        # Headers of urllib are no Mapping, but have its ``get``.
        stated = headers.get("retry-after") if hasattr(headers, "get") else None
        if stated is not None and (seconds := _seconds_until(str(stated), headers)) is not None:
            return max(0.0, seconds)
    return None


def _seconds_until(stated: str, headers: Mapping[str, Any]) -> float | None:
    try:
        seconds = float(stated)
    except ValueError:
        try:
            until = parsedate_to_datetime(stated)
            # By the server's own clock, which may differ from this machine's.
            now = parsedate_to_datetime(headers["date"]) if "date" in headers else datetime.now(UTC)
            seconds = (until - now).total_seconds()
        except (TypeError, ValueError, OverflowError):
            return None
    return seconds if isfinite(seconds) else None
