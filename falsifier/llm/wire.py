"""Messages and tools in the client library's form, and the tool calls that it returns."""

import json
from collections.abc import Sequence
from math import isfinite
from typing import Any

from falsifier.llm.messages import Message, Tool, ToolCall


def sent_message(message: Message) -> dict[str, Any]:
    """Message with OpenAI's field names; an assistant's message that only makes calls has no content."""
    sent: dict[str, Any] = {"role": message.role, "content": message.content}
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
