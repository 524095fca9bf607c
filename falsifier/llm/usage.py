"""What a request cost, in tokens and in money; an unknown cost is None, never zero."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from falsifier.llm.messages import ChatRequest, Usage

# Rule of thumb for English text; for prompt limits, and for providers that send no counts.
_CHARACTERS_PER_TOKEN = 4


@dataclass(frozen=True, slots=True)
class Price:
    """What an LLM costs.

    Attributes:
        prompt: US dollars per 1000 tokens sent.
        completion: US dollars per 1000 tokens received.
    """

    prompt: float
    completion: float

    def cost(self, prompt_tokens: int, completion_tokens: int) -> float:
        """US dollars of one request."""
        return (self.prompt * prompt_tokens + self.completion * completion_tokens) / 1000

    def __str__(self) -> str:
        return f"{self.prompt:.4g} US dollars per 1000 tokens sent, {self.completion:.4g} received"


def estimate_tokens(text: str) -> int:
    """Estimate the number of tokens of a text, rounded up."""
    return -(-len(text) // _CHARACTERS_PER_TOKEN)


def usage_of(
    response_usage: Any, *, request: ChatRequest, text: str, price: Price | None, reported_cost: float | None
) -> Usage:
    """Usage of one answered request.

    Args:
        response_usage: as the provider sent it, with OpenAI's field names; None or zeros: no counts, and
            tokens are estimated.
        request: what was sent.
        text: what was received, including tool calls.
        price: price stated by the user; overrides any reported cost.
        reported_cost: US dollars as computed by the client library; None if the price is unknown.
    """
    prompt = int(getattr(response_usage, "prompt_tokens", None) or 0)
    completion = int(getattr(response_usage, "completion_tokens", None) or 0)
    details = getattr(response_usage, "completion_tokens_details", None)
    reasoning = int(getattr(details, "reasoning_tokens", None) or 0)
    estimated = prompt == 0 and completion == 0
    if estimated:
        prompt = sum(estimate_tokens(part) for part in _sent(request))
        completion = estimate_tokens(text)
    cost = price.cost(prompt, completion) if price is not None else None if estimated else reported_cost
    return Usage(
        prompt_tokens=prompt,
        completion_tokens=completion,
        reasoning_tokens=reasoning,
        cost=cost,
        estimated=estimated,
    )


def _sent(request: ChatRequest) -> Iterator[str]:
    for message in request.messages:
        yield message.content
        yield from (call.arguments for call in message.tool_calls)
    yield from (tool.model_dump_json() for tool in request.tools)
