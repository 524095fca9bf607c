"""Whether a language model can be used: a few short requests, and what was found on what runs need."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from falsifier.errors import ChatError
from falsifier.llm.connect import connect
from falsifier.llm.json_text import objects_in, schema_of_list, schema_of_object, without_thoughts
from falsifier.llm.litellm_adapter import listed_price
from falsifier.llm.messages import MODES, UNREADABLE, Chat, ChatReply, ChatRequest, Message, Tool, Usage
from falsifier.llm.model_file import is_model_file
from falsifier.llm.providers import key_variable
from falsifier.llm.usage import Price

# Enough for a model that reasons before a short answer.
_SHORT, _CUT = 4000, 8
_LONGEST_SHOWN = 60
# In s; a run waits longer.
_TIMEOUT = 60.0
_SCHEMA = schema_of_object(values=schema_of_list({"type": "number"}, 3, 3), rationale={"type": "string"})
_TOOL = Tool(
    name="measure",
    description="Measures the temperature.",
    parameters=schema_of_object(place={"type": "string"}),
)
_ASKED = (
    'Reply with one JSON object in this form, with three numbers that sum to 6: {"values": [3 numbers], '
    '"rationale": "why these"}'
)
_HOW = {
    "bounded_schema": "by a schema with numbers of values",
    "json_schema": "by a schema",
    "json_object": "by asking for any JSON object",
    "prompt": "in words only",
}


@dataclass(frozen=True, slots=True)
class Feature:
    """What was found of one feature.

    Attributes:
        name: what was tried.
        works: whether a run can count on it.
        said: what was found, and what it means.
    """

    name: str
    works: bool
    said: str


@dataclass(frozen=True, slots=True)
class LLMCheck:
    """Result of a few short requests.

    Attributes:
        llm: name of the LLM.
        key: environment variable that contains the key; empty if none is needed.
        price: what the LLM costs; None if unknown.
        features: what was found.
        usage: tokens and cost of all requests.
    """

    llm: str
    key: str
    price: Price | None
    features: tuple[Feature, ...]
    usage: Usage

    @property
    def is_usable(self) -> bool:
        """Whether an answer came that a run could have used."""
        return any(f.name == "answer" and f.works for f in self.features)


def check_llm(
    llm: str,
    *,
    effort: str | None = None,
    api_base: str | None = None,
    options: Mapping[str, Any] | None = None,
    price: Price | None = None,
    timeout: float | None = None,
) -> LLMCheck:
    """Check name and key, and ask the LLM for what runs ask for.

    Raises:
        ChatError: if nothing can be sent, or the first request has no reply.
    """
    chat = connect(
        llm,
        effort=effort,
        api_base=api_base,
        options=options,
        price=price,
        timeout=timeout or _TIMEOUT,
        attempts=2,
    )
    replies: list[ChatReply] = []

    def ask(request: ChatRequest) -> ChatReply:
        replies.append(chat.complete(request))
        return replies[-1]

    answer = ask(_request(_ASKED, schema=_SCHEMA))
    features = [Feature("answer", *_on_answer(answer))]
    if effort is not None:
        features.append(Feature("effort", *_on_effort(chat, answer)))
    for name, request, judge in (
        ("tools", _request("How warm is it in Paris? Measure it.", tools=(_TOOL,)), _on_tools),
        ("length", _request("Count from 1 to 100 in words.", most=_CUT), _on_length),
    ):
        try:
            features.append(Feature(name, *judge(ask(request))))
        except ChatError as error:
            features.append(Feature(name, works=False, said=str(error)))
    listed = Price(0.0, 0.0) if is_model_file(llm) else listed_price(llm, api_base=api_base)
    usage = sum((reply.usage for reply in replies[1:]), replies[0].usage)
    return LLMCheck(llm, key_variable(llm), price or listed, tuple(features), usage)


def _request(
    question: str, *, schema: dict[str, Any] | None = None, tools: tuple[Tool, ...] = (), most: int = _SHORT
) -> ChatRequest:
    message = Message(role="user", content=question)
    return ChatRequest(messages=(message,), reply_schema=schema, tools=tools, max_tokens=most)


def _on_answer(reply: ChatReply) -> tuple[bool, str]:
    mode = str(reply.parameters.get("mode", MODES[-1]))
    how = _HOW.get(mode, mode)
    if reply.finish_reason == "refusal":
        return False, f"refused: {_shown(reply.text)}"
    if reply.finish_reason == UNREADABLE:
        return False, "the server could not parse what the LLM wrote"
    text = without_thoughts(reply.text or reply.reasoning)
    if not text.strip():
        is_cut = reply.finish_reason == "length"
        why = "the token limit went into reasoning; lower the effort" if is_cut else "null"
        return False, f"empty ({why})"
    found = (one.get("values") for one in objects_in(text) if isinstance(one, dict))
    values = next((one for one in found if isinstance(one, list)), None)
    if values is None:
        return False, f"not the JSON that was asked for {how}: {_shown(text)}"
    place = "" if reply.text.strip() else ", in the reasoning instead of the content"
    count = "" if len(values) == 3 else f", but {len(values)} values instead of 3"
    return True, f"JSON asked for {how}{place}{count}"


def _on_effort(chat: Chat, reply: ChatReply) -> tuple[bool, str]:
    if "effort" in reply.parameters.get("dropped", ()):
        return False, f"not taken by {chat.llm}, left out"
    return True, f"sent; {reply.usage.reasoning_tokens} tokens of reasoning reported"


def _on_tools(reply: ChatReply) -> tuple[bool, str]:
    if not reply.parameters.get("tools"):
        return False, "refused by the server; the hybrid engine asks without predictions"
    if not reply.tool_calls:
        return False, "offered, but not called"
    try:
        given = json.loads(reply.tool_calls[0].arguments)
    except ValueError:
        given = None
    if not isinstance(given, dict) or "place" not in given:
        return False, f"called with wrong arguments: {_shown(reply.tool_calls[0].arguments)}"
    return True, "called with the arguments that were asked for"


def _on_length(reply: ChatReply) -> tuple[bool, str]:
    if reply.finish_reason == "length":
        return True, "a reply that is cut off says so"
    return False, f"a limit of {_CUT} tokens was not kept or not told ({reply.finish_reason})"


def _shown(text: str) -> str:
    text = " ".join(text.split())
    return repr(text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]} ...")
