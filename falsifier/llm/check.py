"""Whether a language model can be used: a few short requests, and what was found on what runs need."""

from dataclasses import dataclass
from textwrap import shorten
from typing import Any

from falsifier.errors import ChatError
from falsifier.llm.conversation import NoValidReplyError, RejectedReplyError, converse
from falsifier.llm.json_text import objects_in, schema_of_list, schema_of_object
from falsifier.llm.messages import Chat, ChatRequest, Exchange, Message, Usage

# Tokens; enough for a model that reasons before a short answer.
_SHORT, _CUT = 4000, 8
_LONGEST_SHOWN = 60
_SCHEMA = schema_of_object(values=schema_of_list({"type": "number"}, 3, 3), rationale={"type": "string"})
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
    """What was found of one feature, and what it means: whether a run can count on it."""

    name: str
    works: bool
    said: str


def check_chat(chat: Chat) -> tuple[list[Feature], Usage]:
    """Ask an LLM for what runs ask for.

    Returns:
        What was found, first of all of the ``answer``, without which a run is of no use; tokens and cost.

    Raises:
        ChatError: if the first request has no reply.
    """
    exchanges: list[Exchange] = []
    problem = ""
    try:
        converse(chat, _request(_ASKED, schema=_SCHEMA), _read_values, exchanges.append, reasks=0)
    except NoValidReplyError:
        problem = exchanges[0].problem or ""
    answer = exchanges[0].reply
    assert answer is not None
    sent, usage = answer.parameters, answer.usage
    how = f"JSON asked for {_HOW.get(sent.get('mode', ''), _HOW['prompt'])}"
    features = [Feature("answer", not problem, problem or how)]
    if "effort" in sent.get("dropped", ()):
        features.append(Feature("effort", works=False, said=f"not taken by {chat.llm}, left out"))
    elif "effort" in sent:
        said = f"sent; {usage.reasoning_tokens} tokens of reasoning reported"
        features.append(Feature("effort", works=True, said=said))
    try:
        reply = chat.complete(_request("Count from 1 to 100 in words.", most=_CUT))
    except ChatError as error:
        features.append(Feature("length", works=False, said=str(error)))
        usage += error.lost or Usage(cost=0.0)
    else:
        usage += reply.usage
        works = reply.finish_reason == "length"
        failed = f"a limit of {_CUT} tokens was not kept or not told ({reply.finish_reason})"
        features.append(Feature("length", works, "a reply that is cut off says so" if works else failed))
    return features, usage


def _request(question: str, *, schema: dict[str, Any] | None = None, most: int = _SHORT) -> ChatRequest:
    message = Message(role="user", content=question)
    return ChatRequest(messages=(message,), reply_schema=schema, max_tokens=most)


def _read_values(text: str) -> None:
    if not any(isinstance(one, dict) and isinstance(one.get("values"), list) for one in objects_in(text)):
        raise RejectedReplyError(f"not the JSON that was asked for: {shorten(text, _LONGEST_SHOWN)!r}")
