"""What a request cost, in tokens and in money; an unknown cost is None, never zero.

Tokens are counted without any network; nothing is downloaded. The vocabulary is one that litellm contains.
LLMs differ mainly in how they split numbers: three digits to a token, or each digit alone. For an unlisted
LLM the larger count is used, so that limits hold.
"""

import os
import re
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from math import ceil, isfinite
from pathlib import Path
from typing import Any

from falsifier.errors import SpecError
from falsifier.llm.messages import ChatRequest, Usage

# More than any request can have; a larger count is as wrong as a negative one.
_MOST_TOKENS = 10**9
# The file of the vocabulary cl100k_base, as tiktoken names it in its cache.
_VOCABULARY = "9b5ad71b2ce5302211f9c61530b329a4922fc6a4"
# Characters per token, used if there is no vocabulary: fewer than most prompts for the bundled systems have,
# which are full of numbers. English text alone has about four.
_CHARACTERS_PER_TOKEN = 2.0
_DIGITS = re.compile(r"\d+", re.ASCII)
# Parts of the names of LLMs whose tokenizers group up to three digits.
_GROUPS_DIGITS = ("gpt-", "gpt_", "/o1", "/o3", "/o4", "llama-3", "llama3", "llama-4", "deepseek")


@dataclass(frozen=True, slots=True)
class Price:
    """What an LLM costs.

    Raises:
        SpecError: if a price is negative, infinite or not a number: a limit on the cost would not hold.
    """

    prompt: float  # US dollars per million tokens sent
    completion: float  # US dollars per million tokens received

    def __post_init__(self) -> None:
        for price in (self.prompt, self.completion):
            if not (isfinite(price) and price >= 0):
                raise SpecError(
                    "the price of a language model must be two finite, non-negative numbers, US dollars "
                    f"per million tokens sent and received; got {self.prompt:g} and {self.completion:g}"
                )

    def cost(self, prompt_tokens: int, completion_tokens: int) -> float:
        """US dollars of one request."""
        return (self.prompt * prompt_tokens + self.completion * completion_tokens) / 1e6

    def __str__(self) -> str:
        return f"{self.prompt:.4g} US dollars per million tokens sent, {self.completion:.4g} received"


def usage_of(
    response_usage: Any,
    *,
    llm: str,
    request: ChatRequest,
    text: str,
    price: Price | None,
    reported_cost: float | None,
) -> Usage:
    """Usage of one answered request.

    What a server reports may be wrong. A count that cannot be true (negative, not an integer, 0 for a text)
    is estimated, and a cost that cannot be true is unknown: otherwise the limits of a run would not hold.

    ``response_usage`` is what the provider sent, with OpenAI's field names; without counts, tokens are
    counted here. The user's ``price`` overrides the ``reported_cost``, which the client library computed.
    """
    prompt = possible_count(getattr(response_usage, "prompt_tokens", None))
    completion = possible_count(getattr(response_usage, "completion_tokens", None))
    details = getattr(response_usage, "completion_tokens_details", None)
    reasoning = possible_count(getattr(details, "reasoning_tokens", None))
    kept = getattr(response_usage, "prompt_tokens_details", None)
    cached = possible_count(getattr(kept, "cached_tokens", None))
    estimated = not prompt or (not completion and bool(text))
    prompt = prompt or tokens_sent(request, llm)
    completion = completion or count_tokens(text, llm)
    if price is not None:
        cost: float | None = price.cost(prompt, completion)
    else:
        cost = None if estimated else _believable(reported_cost)
    return Usage(
        prompt_tokens=prompt,
        completion_tokens=completion,
        cached_tokens=min(cached, prompt),
        reasoning_tokens=min(reasoning, completion),
        cost=cost,
        estimated=estimated,
    )


def possible_count(reported: Any) -> int:
    """A reported number of tokens; 0 if none was reported, or one that cannot be true."""
    is_number = isinstance(reported, int | float) and not isinstance(reported, bool)
    is_possible = is_number and 0 <= reported <= _MOST_TOKENS and reported == int(reported)
    return int(reported) if is_possible else 0


def _believable(cost: Any) -> float | None:
    return float(cost) if isinstance(cost, int | float) and isfinite(cost) and cost >= 0 else None


def tokens_sent(request: ChatRequest, llm: str) -> int:
    """Count the tokens of a request."""
    return sum(count_tokens(message.content, llm) for message in request.messages)


def count_tokens(text: str, llm: str = "") -> int:
    """Count the tokens of a text; if no LLM is named, for one that groups up to three digits."""
    encoding = _encoding()
    if encoding is None:
        return ceil(len(text) / _CHARACTERS_PER_TOKEN)
    count = len(encoding.encode_ordinary(text))
    if not llm or any(part in llm.lower() for part in _GROUPS_DIGITS):
        return count
    # So many more there are if each digit is a token.
    return count + sum(len(found[0]) - -(-len(found[0]) // 3) for found in _DIGITS.finditer(text))


@cache
def _encoding() -> Any:
    """The tokenizer; None if the vocabulary is not installed."""
    package = find_spec("litellm")
    for place in package.submodule_search_locations or () if package else ():
        folder = Path(place) / "litellm_core_utils" / "tokenizers"
        if (folder / _VOCABULARY).is_file() and find_spec("tiktoken"):
            os.environ.setdefault("TIKTOKEN_CACHE_DIR", str(folder))  # as litellm does itself
            if Path(os.environ["TIKTOKEN_CACHE_DIR"], _VOCABULARY).is_file():
                import tiktoken

                return tiktoken.get_encoding("cl100k_base")
    return None
