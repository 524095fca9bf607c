"""Tokens and what they cost."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from falsifier.llm import usage as tokens
from falsifier.llm.messages import ChatRequest, Message, Usage
from falsifier.llm.usage import Price, count_tokens, usage_of

REQUEST = ChatRequest(messages=(Message(role="user", content="x" * 400),))
COUNTED = SimpleNamespace(
    prompt_tokens=100, completion_tokens=20, completion_tokens_details=SimpleNamespace(reasoning_tokens=12)
)
PRICE = Price(prompt=0.25, completion=2.0)


def usage(response: Any, *, price: Price | None = None, reported: float | None = None) -> Usage:
    return usage_of(response, llm="", request=REQUEST, text="y" * 41, price=price, reported_cost=reported)


def test_counts_and_cost_are_the_providers_unless_there_is_a_price_of_ones_own() -> None:
    found = usage(COUNTED, reported=0.5)
    assert (found.prompt_tokens, found.completion_tokens, found.reasoning_tokens) == (100, 20, 12)
    assert (found.cost, found.estimated) == (0.5, False)
    assert usage(COUNTED, price=PRICE, reported=0.5).cost == pytest.approx((100 * 0.25 + 20 * 2.0) / 1e6)
    assert usage(COUNTED).cost is None, "an unknown price is never zero"
    assert usage(None, reported=0.0).cost is None, "nor is that of counts that were estimated"


NUMBERS = "speed: 0:0 2.5:34.7 5:54.21 20:119.581"


@pytest.fixture(autouse=True)
def _fresh() -> Iterator[None]:
    tokens._encoding.cache_clear()
    yield
    tokens._encoding.cache_clear()


def test_words_and_numbers_are_counted_without_a_network() -> None:
    assert count_tokens("") == 0
    assert count_tokens("The requirement is violated.") == 5
    assert count_tokens("119.581") == 3, "three digits are one token"


def test_an_unlisted_llm_is_counted_as_if_each_digit_were_a_token() -> None:
    assert count_tokens("119.581", "openai/gpt-5-mini") == 3
    assert count_tokens("119.581", "ollama/gpt-oss:20b") == 3
    assert count_tokens("119.581", "ollama/qwen3:8b") == 7
    assert count_tokens("a word", "ollama/qwen3:8b") == count_tokens("a word")


def test_without_a_vocabulary_numbers_are_not_counted_as_english(monkeypatch: pytest.MonkeyPatch) -> None:
    exact = count_tokens(NUMBERS)
    tokens._encoding.cache_clear()
    monkeypatch.setattr(tokens, "find_spec", lambda _: None)
    assert count_tokens(NUMBERS) == len(NUMBERS) / 2
    assert 0.6 * exact < count_tokens(NUMBERS) < 1.7 * exact
