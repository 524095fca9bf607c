"""Bodies of replies: what is mended before a client library reads one, and what is wrong with it."""

import json
import re
from contextlib import suppress
from typing import Any

from falsifier.llm.usage import possible_count

# A finish reason that client libraries take for a proper end, and where it stands in replies.
_EXCEEDED, _REASONS = "model_context_window_exceeded", ("finish_reason", "stop_reason")
# Maximum number of characters of a reply that an error repeats.
_LONGEST_BEGINNING = 80
# What to check where something else than a language model answers.
ADDRESS = "check host, port and http or https in the server's address"
NO_LLM = f"that is not a language model's server; {ADDRESS}"


class BrokenReplyError(Exception):
    """No reply came, or not one of an LLM's server; the message says what is wrong, and what to do."""

    status_code: int | None = None  # as the server reports it within a reply that has none
    patience: int | None = None  # number of such replies after which none is better; None: no limit


class UnusableReplyError(BrokenReplyError):
    """An LLM's server answered, so that the request is paid for, but with nothing that can be used."""


def unreadable(body: bytes) -> BrokenReplyError:
    """What is wrong with the body of a reply; said only if the client library cannot read it either."""
    begins = body.decode(errors="replace")[:_LONGEST_BEGINNING].strip()
    found = f"it begins with {begins!r}" if begins else "it is empty"
    try:
        sent = json.loads(body.decode(errors="replace"))
    except RecursionError:
        return BrokenReplyError(f"the reply is nested too deeply to be read: {NO_LLM}")
    except ValueError:
        return BrokenReplyError(
            f"the reply is not JSON ({found}): check the server's address, which for most servers ends with "
            "/v1, and its log; a proxy or a page for signing in may answer in its place"
        )
    if isinstance(sent, dict) and (error := sent.get("error")):
        return _reported(error)
    if isinstance(sent, dict) and sent.get("choices") == []:
        return UnusableReplyError(
            "the server answers without any choice; its log, or the provider's page on the state of the "
            "service, says why"
        )
    kind = UnusableReplyError if isinstance(sent, dict) else BrokenReplyError
    return kind(
        f"the reply does not have the form of an LLM's ({found}): check the server's address, and that the "
        "LLM's name begins with the provider whose interface the server has"
    )


def _reported(error: Any) -> BrokenReplyError:
    """What a server reports in place of an answer; without a status it is taken for a temporary failure."""
    stated = error if isinstance(error, dict) else {"message": error}
    told, code = stated.get("message") or error, str(stated.get("code"))
    fault = BrokenReplyError(f"the server reports: {told if isinstance(told, str) else json.dumps(told)}")
    fault.status_code = int(code) if re.fullmatch("[45][0-9][0-9]", code) else 503
    return fault


def with_error_apart(body: bytes) -> bytes:
    """The body, or just the error in its choice, as OpenRouter sends it: that reads as an empty reply."""
    with suppress(ValueError, RecursionError, TypeError, LookupError, AttributeError):
        if error := json.loads(body)["choices"][0].get("error"):
            return json.dumps({"error": error}).encode()
    return body


def mended(body: bytes) -> bytes:
    """The body without what the client library would reject all of it for, but what can be read.

    These are counts of tokens that cannot be true, texts in parts, and bytes that are no UTF-8. A finish
    reason that the library would take for a proper end is the one of all replies that were cut off.
    """
    sent = json.loads(body.decode(errors="replace"))
    usage, choices = sent.get("usage"), sent.get("choices")
    if "usage" in sent:
        sent["usage"] = _possible(usage) if isinstance(usage, dict) else None
    if isinstance(choices, list):
        sent["choices"] = [_with_known_end(_with_one_text(choice)) for choice in choices]
    return json.dumps(_with_known_end(sent)).encode()


def _with_known_end(part: Any) -> Any:
    """A reply, or a choice of it, whose reason is that of all that were cut off, if its context was full."""
    is_full = isinstance(part, dict) and any(part.get(key) == _EXCEEDED for key in _REASONS)
    return {k: "length" if k in _REASONS else v for k, v in part.items()} if is_full else part


def _with_one_text(choice: Any) -> Any:
    """A choice whose content is one text; some servers send a list of parts, or the object itself."""
    message = choice.get("message") if isinstance(choice, dict) else None
    content = message.get("content") if isinstance(message, dict) else None
    parts = [json.dumps(content)] if isinstance(content, dict) else content
    if not isinstance(message, dict) or not isinstance(parts, list):
        return choice
    # Other parts, such as what was thought before, have no text of their own.
    texts = [part.get("text") if isinstance(part, dict) else part for part in parts]
    said = [text for text in texts if isinstance(text, str)]
    return {**choice, "message": {**message, "content": "".join(said)}} if said else choice


def _possible(usage: dict[str, Any]) -> dict[str, Any]:
    found = dict(usage)
    for name, count in usage.items():
        if isinstance(count, dict):
            found[name] = _possible(count)
        elif name.endswith("_tokens") and count is not None:
            found[name] = possible_count(count)
    return found
