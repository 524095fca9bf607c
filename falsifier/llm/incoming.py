"""What servers send, as it may be recorded and shown."""

import json
from collections.abc import Iterable
from typing import Any

from falsifier.core.printable import printable
from falsifier.core.secrets import redact_held
from falsifier.llm.messages import ChatReply, ToolCall

# Some 250,000 tokens, more than any LLM writes in one reply. What is longer is cut, and rejected when read.
LONGEST_REPLY = 1_000_000
# Each call is answered with a message; no LLM makes more than a few at a time.
_MOST_CALLS = 100


def cleaned(reply: ChatReply, secrets: Iterable[str] = ()) -> ChatReply:
    """Return a reply without secrets and without what a terminal would act on, and not longer than the limit.

    Args:
        reply: as it came.
        secrets: secrets in addition to those in the environment: an LLM or a server may repeat what it was
            sent.
    """
    secrets = tuple(secrets)

    def text(sent: str) -> str:
        return redact_held(printable(sent[:LONGEST_REPLY]), secrets)

    def echo(sent: dict[str, Any]) -> dict[str, Any]:
        # Sent back to the provider as it is, and never shown.
        plain = json.dumps(sent, default=str) if sent else ""
        clean = redact_held(plain, secrets)
        return sent if clean == plain else dict(json.loads(clean))

    def call(sent: ToolCall) -> ToolCall:
        return ToolCall(
            id=text(sent.id), name=text(sent.name), arguments=text(sent.arguments), echo=echo(sent.echo)
        )

    return reply.model_copy(
        update={
            "text": text(reply.text),
            "reasoning": text(reply.reasoning),
            "finish_reason": text(reply.finish_reason),
            "tool_calls": tuple(map(call, reply.tool_calls[:_MOST_CALLS])),
            "echo": echo(reply.echo),
        }
    )
