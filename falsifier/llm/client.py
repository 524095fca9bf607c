"""The chat with an LLM behind litellm.

It asks in the strictest way that the server accepts, and again after passing failures. Valid replies are kept
on disk, keyed by the content of the request.
"""

import json
import logging
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from random import uniform
from time import perf_counter, sleep
from typing import Any

from pydantic import ValidationError

from falsifier.core.files import write_whole
from falsifier.core.secrets import redact_held, secrets_in, without_credentials, without_secrets
from falsifier.core.words import counted
from falsifier.errors import ChatError
from falsifier.llm import litellm_adapter
from falsifier.llm.failures import FormatUnsupportedError, TransientChatError, UnreadableReplyError, classify
from falsifier.llm.json_text import without_limits
from falsifier.llm.messages import (
    MODES,
    TOOL_CALL,
    UNREADABLE,
    ChatReply,
    ChatRequest,
    Message,
    Mode,
    Usage,
    cleaned,
)
from falsifier.llm.providers import find_key, known, provider_of, server_address, unset_key
from falsifier.llm.reply_bodies import UnusableReplyError
from falsifier.llm.transport import within
from falsifier.llm.usage import Price, tokens_sent, usage_of

_LOG = logging.getLogger(__name__)

# With doubling delays the last request is sent about a minute after the first: enough for a server restart.
DEFAULT_ATTEMPTS = 7
# In s; if the server asks for a longer wait, the request fails.
_FIRST_DELAY, _LONGEST_DELAY = 1.0, 120.0
# In s; reasoning models may think for minutes.
DEFAULT_TIMEOUT = 600.0
# Replies in a row that the server could not parse, before they are asked for in a plainer way: one is the
# LLM's mistake, several are the server's.
_MOST_UNREADABLE = 2
# Characters of the name of a tool that are told.
_LONGEST_NAME = 60
# Providers whose server is that of OpenAI.
_OF_OPENAI = ("openai", "text-completion-openai")
# In s; the longest that a socket can wait is 2**31 ms.
_LONGEST_TIMEOUT = 2e6


@dataclass
class LiteLLMChat:
    """An LLM of any provider that litellm supports; ``connect`` says what most of its attributes mean.

    It is asked by JSON Schema, else for any JSON object, else in words only; what worked is remembered. The
    next way is tried if the server rejects one, or repeatedly cannot parse what it makes the LLM write.

    Attributes:
        mode: how the next reply that follows a schema is asked for.
        content: what the server serves, if it was started for a model file; records then say this instead
            of the server's address, which is another one each time.
    """

    llm: str
    effort: str | None = None
    api_base: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    timeout: float = DEFAULT_TIMEOUT
    price: Price | None = None
    mode: Mode = "json_schema"
    content: str = ""
    attempts: int = DEFAULT_ATTEMPTS
    cache: Path | None = None
    _unreadable: int = field(init=False, default=0)

    @property
    def address(self) -> str:
        """Where prompts are sent, without a password or a key; empty: to the provider, or a model file."""
        address = "" if self.content else server_address(self.llm, self.api_base) or ""
        return redact_held(without_credentials(address))

    @property
    def parameters(self) -> Mapping[str, Any]:
        """What is sent in addition to the messages, without secrets."""
        stated = {"effort": self.effort, "content": self.content or None}
        if self.api_base and not self.content:
            stated["api_base"] = self.address
        return {**{k: v for k, v in stated.items() if v is not None}, **without_secrets(self._options())}

    def complete(self, request: ChatRequest) -> ChatReply:
        """Return the kept reply, at no cost; else ask in the strictest way that the server accepts.

        After temporary failures it is asked again.

        Raises:
            ChatError: if no reply can be obtained.
        """
        if self.cache is not None:
            with suppress(OSError, ValidationError):  # missing or damaged: ask again and overwrite it
                kept = ChatReply.model_validate_json(self._place(self.cache, request).read_bytes())
                free = {"usage": Usage(cost=0.0, kept=1), "seconds": 0.0, "source": "cache"}
                return kept.model_copy(update=free)
        lost: list[Usage] = []
        failures: list[TransientChatError] = []
        try:
            while True:
                try:
                    reply = self._asked(request)
                    attempts = len(failures) + 1
                    return reply.model_copy(update={"attempts": attempts, "usage": sum(lost, reply.usage)})
                except TransientChatError as error:
                    lost += [error.lost] if error.lost else []
                    failures.append(error)
                    used = sum(lost, Usage(cost=0.0))
                    if used.tokens >= request.spare[0] or (used.cost or 0.0) >= request.spare[1]:
                        raise ChatError(f"a limit is reached. {error}") from None
                    self._wait(failures, request)
        except BaseException as error:  # Ctrl-C, too
            lost += [own] if (own := getattr(error, "lost", None)) else []
            if lost:
                error.lost = sum(lost[1:], lost[0])  # type: ignore[attr-defined]
            raise

    def _wait(self, failures: Sequence[TransientChatError], request: ChatRequest) -> None:
        """Wait before the next request: as the server asks, else twice as long as before, with jitter.

        Failures whose patience is limited are counted apart from the others, such as those of a busy server.

        Raises:
            ChatError: if there is no next request, or if it is not worth waiting for.
        """
        error, attempt = failures[-1], len(failures)
        others = sum(failure.patience is None for failure in failures)
        limit = min(self.attempts, others + (error.patience or self.attempts))
        if attempt >= limit:
            raise ChatError(f"{counted(attempt, 'attempt')} failed, the last one so: {error}") from None
        delay = error.retry_after
        if delay is None:
            delay = min(_FIRST_DELAY * 2 ** (attempt - 1) * uniform(0.75, 1.25), _LONGEST_DELAY)
        elif delay > _LONGEST_DELAY:
            raise ChatError(f"the server asks to wait {delay:g} s; try again later. {error}") from None
        left = request.seconds_left
        if left is not None and delay >= left:
            raise ChatError(f"no time is left to ask again. {error}") from None
        _LOG.warning("%s. Retrying in %.0f s (attempt %d of %d).", error, delay, attempt + 1, limit)
        sleep(delay)

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Keep a valid reply, if the directory can be written: it is paid for, so that the run goes on."""
        if self.cache is None or reply.source == "cache":
            return
        try:  # several runs may store the same reply at the same time
            write_whole(self._place(self.cache, request), reply.model_dump_json(indent=1))
        except OSError as error:
            _LOG.warning("The reply is not kept for later runs: cannot write to %s (%s).", self.cache, error)

    def _place(self, cache: Path, request: ChatRequest) -> Path:
        asked = {
            "llm": self.llm,
            "parameters": dict(self.parameters),
            "request": request.model_dump(mode="json"),
        }
        if self.api_base and not self.content:  # whole, where parameters have it without a password
            asked["server"] = sha256(self.api_base.encode()).hexdigest()
        digest = sha256(json.dumps(asked, sort_keys=True, default=str).encode()).hexdigest()
        return cache / digest[:2] / f"{digest}.json"

    def _asked(self, request: ChatRequest) -> ChatReply:
        while True:
            below = MODES[MODES.index(self.mode) + 1 :] if request.reply_schema is not None else ()
            try:
                reply = self.send(request)
            except FormatUnsupportedError:
                if not below:
                    raise
                self.mode = below[0]
            else:
                # After several that the server could not parse, ask in a plainer way from now on.
                self._unreadable = self._unreadable + 1 if reply.finish_reason == UNREADABLE else 0
                if self._unreadable >= _MOST_UNREADABLE and below:
                    self._unreadable = 0
                    self.mode = below[0]
                return reply

    def send(self, request: ChatRequest) -> ChatReply:
        """Send one request.

        Returns:
            The reply; one without text, and with the finish reason ``UNREADABLE``, if the server could not
            parse what the LLM wrote.

        Raises:
            TransientChatError: if a retry may succeed.
            FormatUnsupportedError: if the server rejects this way of asking for JSON.
            ChatError: for any other failure.
        """
        key = find_key(self.llm, api_base=self.api_base)
        secrets = (key or "", *secrets_in(self.options))
        # litellm sends it to other providers' servers if it knows no key of theirs.
        others = os.environ.get("OPENAI_API_KEY", "").strip()
        is_of_openai = provider_of(self.llm) in _OF_OPENAI
        is_meant = key is not None or is_of_openai or others in secrets  # as an option, in Python
        withheld = {} if is_meant else {others: f"the key of OpenAI; {unset_key(self.llm)}"}
        withheld[""] = f"a key of blanks only; {unset_key(self.llm)}"
        stated = {*secrets, *map(str, self.options.values())}
        dropped = [] if is_of_openai else litellm_adapter.headers_of_openai()
        dropped = [(name, value) for name, value in dropped if value not in stated]
        litellm_adapter.load_litellm()
        arguments = self._arguments(request)
        left = request.seconds_left
        if left is not None and left <= 0:  # the import above may have taken it
            raise ChatError(f"{self.llm}: nothing was sent: the time limit ended while the client was loaded")
        timeout = min(self.timeout, _LONGEST_TIMEOUT)
        started = perf_counter()

        def ask() -> ChatReply:
            response = litellm_adapter.completed(
                self.llm,
                messages=[_sent(m, marks=known(self.llm).marks) for m in request.messages],
                api_base=server_address(self.llm, self.api_base),
                timeout=timeout,
                **{"api_key": key, **arguments},
            )
            return self._reply(request, response, arguments, perf_counter() - started)

        try:
            seconds = timeout if left is None else min(timeout, left)
            never = () if is_of_openai else (litellm_adapter.HOST_OF_OPENAI,)
            return cleaned(within(seconds, ask, never=never, withheld=withheld, dropped=dropped), secrets)
        except KeyboardInterrupt as stop:  # the provider charges for what it has been sent, or has answered
            stop.lost = self._lost(request, without_reply=1)  # type: ignore[attr-defined]
            raise
        except Exception as error:  # litellm raises its own errors, its clients' and plain built-in ones
            failure = classify(
                error, llm=self.llm, api_base=self.api_base, secrets=secrets, options=self.options
            )
            if isinstance(failure, UnreadableReplyError):
                return ChatReply(
                    text="",
                    finish_reason=UNREADABLE,
                    usage=self._lost(request, without_reply=0),
                    seconds=perf_counter() - started,
                    parameters=self._effective(arguments),
                )
            is_paid = isinstance(error, TimeoutError | UnusableReplyError)
            if is_paid or type(error).__name__ == "Timeout":
                failure.lost = self._lost(request, without_reply=1)
            raise failure from None

    def _lost(self, request: ChatRequest, *, without_reply: int) -> Usage:
        """Usage of a request that brought nothing: the provider charges at least for what was sent."""
        price = self.price or litellm_adapter.listed_price(self.llm, api_base=self.api_base)
        sent = tokens_sent(request, self.llm)
        cost = None if price is None else price.cost(sent, 0)
        return Usage(prompt_tokens=sent, cost=cost, estimated=True, without_reply=without_reply)

    def _options(self) -> dict[str, Any]:
        return {**known(self.llm).defaults, **self.options}

    def _arguments(self, request: ChatRequest) -> dict[str, Any]:
        arguments = self._options()
        if self.effort is not None:
            arguments["reasoning_effort"] = self.effort
            if known(self.llm).names_effort:
                arguments["allowed_openai_params"] = ["reasoning_effort"]
        schema = request.reply_schema
        if schema is not None and self.mode in ("bounded_schema", "json_schema"):
            schema = schema if self.mode == "bounded_schema" else without_limits(schema)
            arguments["response_format"] = {
                "type": "json_schema",
                "json_schema": {"name": "reply", "strict": True, "schema": schema},
            }
        elif schema is not None and self.mode == "json_object":
            arguments["response_format"] = {"type": "json_object"}
        if request.max_tokens:
            arguments["max_tokens"] = max(request.max_tokens, arguments.get("max_tokens") or 0)
        return arguments

    def _reply(
        self, request: ChatRequest, response: Any, arguments: Mapping[str, Any], seconds: float
    ) -> ChatReply:
        choice = response.choices[0]
        refusal = _refusal(choice.message)
        refused = bool(refusal) and not choice.message.content
        # Some servers put the whole answer into a call of a tool that nobody offered.
        calls = [call.function for call in getattr(choice.message, "tool_calls", None) or ()]
        places = (choice.message.content or refusal, *(call.arguments for call in calls))
        text = next((place for place in places if (place or "").strip()), "")
        finish = "refusal" if refused else choice.finish_reason or ""
        if calls and not places[0] and finish != "length":
            finish = f"{TOOL_CALL}{str(calls[0].name)[:_LONGEST_NAME]!r}"
        cost = (getattr(response, "_hidden_params", None) or {}).get("response_cost")
        # Another server under a listed name has its own prices, and zero is true of local ones only.
        is_true = known(self.llm).local or (cost and self.api_base is None)
        return ChatReply(
            text=text,
            reasoning=getattr(choice.message, "reasoning_content", None) or "",
            finish_reason=finish,
            usage=usage_of(
                getattr(response, "usage", None),
                llm=self.llm,
                request=request,
                text=text,
                price=self.price,
                reported_cost=cost if is_true else None,
            ),
            seconds=seconds,
            parameters=self._effective(arguments),
        )

    def _effective(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """What was sent in addition to the messages; ``dropped`` lists what this LLM does not accept."""
        dropped = litellm_adapter.dropped_parameters(self.llm, arguments)
        omitted = {"effort" if name == "reasoning_effort" else name for name in dropped}
        effective = {k: v for k, v in self.parameters.items() if k not in omitted}
        effective["mode"] = self.mode if "response_format" in arguments else "prompt"
        if "max_tokens" in effective:
            effective["max_tokens"] = arguments["max_tokens"]
        return {**effective, "dropped": sorted(omitted)} if omitted else effective


def _sent(message: Message, *, marks: bool) -> dict[str, Any]:
    """Message with OpenAI's field names; with marks, what the next question will begin with is marked."""
    sent: dict[str, Any] = {"role": message.role, "content": message.content}
    if marks and message.stable:
        kept, rest = message.content[: message.stable], message.content[message.stable :]
        sent["content"] = [
            {"type": "text", "text": kept, "cache_control": {"type": "ephemeral"}},
            *([{"type": "text", "text": rest}] if rest else []),
        ]
    return sent


def _refusal(message: Any) -> str:
    """Why the LLM declined, if the provider reports that in a separate field."""
    fields = getattr(message, "provider_specific_fields", None) or {}
    return str(getattr(message, "refusal", None) or fields.get("refusal") or "")
