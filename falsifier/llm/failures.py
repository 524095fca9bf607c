"""Failures of requests to a language model, classified by what can be done about them."""

import ast
import json
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import Any
from urllib.parse import urlsplit

from falsifier.core.literals import number_in, printable
from falsifier.core.secrets import redact, redact_held, without_credentials
from falsifier.core.words import shortened, without_full_stop
from falsifier.errors import ChatError, ContextExceededError, setting
from falsifier.llm.litellm_adapter import own_words, without_trace
from falsifier.llm.providers import known, server_address, unset_key
from falsifier.llm.reply_bodies import BrokenReplyError
from falsifier.llm.transport import RefusedReplyError

# 200: the body is not JSON, typically an HTML page from a proxy.
_TRANSIENT_STATUS = frozenset({200, 408, 409, 425, 429})
_FORMAT = (
    "response_format|json_object|structured output|grammar|schema|json mode|response mime type"
    "|failed to initialize samplers"  # llama.cpp, if it cannot constrain this LLM in this way
)
# Some servers (llama.cpp, Groq) parse what the LLM wrote, and fail if it has not the required form.
_UNREADABLE = (
    "the model produced output that does not match|failed to parse input at pos"
    "|failed to generate json|failed to validate json"
)
# litellm's class, llama.cpp, LM Studio, OpenAI; vLLM in three versions; Groq. A pool is what others use up.
_CONTEXT = "context[ _]?(window|size|length)(?! pool)|maximum model length|too long to fit|reduce the length"
_LONGEST_DETAIL = 600
_LONGEST_BODY = 100_000
# How OpenAI's client begins an error whose JSON it does not know; it follows as Python would write it.
_CLIENT = re.compile(r"^Error code: \d+ - ")
_OF_WORDS = ("message", "error", "detail", "msg")
_LETTERS = re.compile(r"[^\W\d_]{2}")
# The title of a page that a proxy answers with says what the page says.
_TITLE = re.compile(r"<title>([^<]+)</title>", re.IGNORECASE)
_LONGER = (
    "start its server with a longer context (llama.cpp: --ctx-size 32768; vLLM: --max-model-len 32768), or "
)
_TOO_LARGE = (
    "the request is larger than the server, a proxy before it, or the account's limit per minute allows; use "
    "a plainer prompt variant, or raise that limit. {detail}"
)
# Requests to a local server that refuses connections: enough for one that is just starting.
_LOCAL_PATIENCE = 3
# How long to wait, as OpenAI and Groq ("try again in 1m7.5s", "450ms") and Gemini ("retry in 34.07s") say it.
_WAIT = re.compile(r"(?i)try (?:again )?(?:in|after) (?:(\d+)h)?(?:(\d+)m)?(\d+(?:\.\d+)?) ?(m?)s")
_THIS_MACHINE = ("localhost", "127.0.0.1", "::1", "0.0.0.0")


class TransientChatError(ChatError):
    """A temporary failure: rate limit, timeout, lost connection, overloaded server."""

    def __init__(
        self, message: str, *, retry_after: float | None = None, patience: int | None = None
    ) -> None:
        self.retry_after = retry_after  # in s, as the server asked to wait
        self.patience = patience  # number of such failures that end a question; None: no limit of its own
        super().__init__(message)


class FormatUnsupportedError(ChatError):
    """The server does not accept this way of asking for JSON."""


class UnreadableReplyError(ChatError):
    """The LLM answered, but its server could not parse that in the form that was asked for."""


# What a failure may be: its HTTP statuses (none listed: any, or none), a pattern of its words (empty:
# whatever it says), the class of the error, and cause and cure, with the server's own words as ``{detail}``.
# The first one that fits counts.
_CURES: tuple[tuple[tuple[int, ...], str, type[ChatError], str], ...] = (
    (
        (403,),
        # A key that is right may belong to an account that is not.
        "organi[sz]ation|project|verif|not have access|region|country",
        ChatError,
        "the account behind {keys} may not use this LLM: have it allowed for the organisation or project of "
        "the key, or take another LLM or key. {detail}",
    ),
    ((413,), "", ContextExceededError, _TOO_LARGE),
    # OpenAI and Groq, of a limit of tokens per minute: no wait helps.
    ((429,), "request too large", ContextExceededError, _TOO_LARGE),
    ((401, 403), "", ChatError, "the provider rejected the key; check {keys}. {detail}"),
    # Of litellm and of OpenAI's client, before anything is sent.
    ((), "_api_key is not set", ChatError, "{detail}"),
    ((), "missing credentials. please pass", ChatError, "no API key: {unset}"),
    ((400, 422, 500), _UNREADABLE, UnreadableReplyError, "{detail}"),
    (
        (404,),
        "",
        ChatError,
        "no such LLM or address; check the LLM's name and the server's address{account}. {detail}",
    ),
    (
        (),
        "content_?policy|content management policy",
        ChatError,
        "the provider's content filter rejected the prompt; try another LLM, or neutral names. {detail}",
    ),
    (
        (),
        _CONTEXT,
        ContextExceededError,
        "the prompt is too long for this LLM; {longer}use a plainer prompt variant or another LLM. "
        "The server says: {detail}",
    ),
    (
        (429,),
        "insufficient_quota|exceeded your current quota|billing",
        ChatError,
        "the account behind {keys} has no quota left. {detail}",
    ),
    ((400, 422, 501), _FORMAT, FormatUnsupportedError, "{detail}"),
)


def classify(
    error: Exception, *, llm: str, api_base: str | None, secrets: Iterable[str], options: Iterable[str] = ()
) -> ChatError:
    """Translate what the client library raised into an error of this package, without secrets.

    The ``options`` are those that the user passes on, by name.
    """
    provider, address = known(llm), server_address(llm, api_base)
    told = redact_held(without_credentials(address or ""), secrets)
    where = f"{llm} at {told}: " if address else f"{llm}: "
    if address and _is_refused(error) and (urlsplit(address).hostname or "") in _THIS_MACHINE:
        start = f"the server with '{provider.start}'" if provider.start else "the LLM's server"
        return TransientChatError(
            f"{llm}: nothing is listening at {told}: start {start}, or correct {setting('api_base')}",
            patience=_LOCAL_PATIENCE,
        )
    said = redact(printable(str(error)), secrets)
    if isinstance(error, RefusedReplyError):
        return ChatError(where + said)
    if isinstance(error, BrokenReplyError) and error.status_code is None:
        return TransientChatError(where + said, patience=error.patience)
    status, text = _status(error), without_trace(f"{type(error).__name__}: {said}")
    wait = _retry_after(error)
    lowered = shortened(text, _LONGEST_DETAIL).lower()
    refused = next((o for o in options if re.search(rf"\b{re.escape(o.lower())}\b", lowered)), "")
    keys = " or ".join(provider.keys)
    filled = {
        "keys": keys or "the API key",
        "unset": unset_key(llm),
        "account": f", and whether the account behind {keys} may use it" if keys else "",
        "longer": _LONGER if api_base is not None or provider.local else "",
        "detail": _detail(text, status),
    }
    # Gemini calls a limit per minute an exceeded quota, too, and tells a wait even if a day's is used up.
    if status == 429 and "PerDay" not in text and (found := _WAIT.search(text)):
        hours, minutes, number, milli = found.groups(default="0")
        spoken = 3600 * int(hours) + 60 * int(minutes) + float(number) / (1000 if milli == "m" else 1)
        return TransientChatError(where + filled["detail"], retry_after=spoken if wait is None else wait)
    if status in (400, 422) and refused and not re.search(_UNREADABLE, lowered):
        return ChatError(f"{where}the server refuses the option {refused}; drop it. {filled['detail']}")
    for statuses, words, kind, cure in _CURES:
        if re.search(words, lowered) and (status in statuses or not statuses):
            return kind(where + cure.format(**filled))
    is_connection = isinstance(error, ConnectionError | TimeoutError)
    if status in _TRANSIENT_STATUS or (status or 0) >= 500 or is_connection:
        return TransientChatError(where + filled["detail"], retry_after=wait)
    return ChatError(where + filled["detail"])


def _detail(text: str, status: int | None) -> str:
    """What the server said in one line, out of its JSON or its page, and without the full stop.

    More follows in most messages.
    """
    said = own_words(text)
    body = _CLIENT.sub("", said)
    read = json.loads if body == said else ast.literal_eval
    told = ""
    with suppress(ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
        told = _words(read(body[:_LONGEST_BODY]))
    if title := _TITLE.search(said):
        told = title[1]
    detail = without_full_stop(shortened(" ".join((told.strip() or body).split()), _LONGEST_DETAIL))
    if status is not None and not _LETTERS.search(detail):
        return f"the server answers with the HTTP status {status} and without a reason"
    return detail


def _words(stated: object) -> str:
    """The words in the JSON of an error, as servers nest them: empty if there are none."""
    if isinstance(stated, dict):
        return next(filter(None, (_words(stated.get(key)) for key in _OF_WORDS)), "")
    if isinstance(stated, list):
        return _words(stated[0]) if stated else ""
    return stated if isinstance(stated, str) else ""


def _status(error: Exception) -> int | None:
    status = getattr(error, "status_code", None)
    return int(status) if isinstance(status, int | str) and str(status).isdigit() else None


def _is_refused(error: BaseException | None) -> bool:
    """Whether a connection was refused; the client libraries wrap that error several times."""
    while error is not None:
        if isinstance(error, ConnectionRefusedError) or "connection refused" in str(error).lower():
            return True
        error = error.__cause__ or error.__context__
    return False


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
    if (seconds := number_in(stated)) is not None:
        return seconds
    try:
        until = parsedate_to_datetime(stated)
        # By the server's own clock, which may differ from this machine's.
        now = parsedate_to_datetime(headers["date"]) if "date" in headers else datetime.now(UTC)
        return (until - now).total_seconds()
    except (TypeError, ValueError, OverflowError):
        return None
