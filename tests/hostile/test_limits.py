"""Prices, counts and dates that cannot be true: no limit of a run is lifted by them."""

import math
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, strategies as st
from pydantic import ValidationError

from falsifier.engines.llm import LLMEngine
from falsifier.errors import SpecError
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.failures import TransientChatError, classify
from falsifier.llm.messages import ChatRequest, Message
from falsifier.llm.usage import Price, usage_of
from falsifier.record.run import falsify
from falsifier.search.budget import Budget
from falsifier.search.request import LLMSettings
from falsifier.search.result import Result
from falsifier.testing import lag_problem
from tests.hostile.servers import Behaviour, answers, misbehaving

REQUEST = ChatRequest(messages=(Message(role="user", content="a question of some words"),))
WRONG_PRICES = ["nan:nan", "nan:1", "1:inf", "-1:2", "0.25:-2", "-inf:0"]
ANYTHING = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=4),
    st.lists(st.integers(), max_size=2),
)


@pytest.mark.parametrize("price", WRONG_PRICES)
def test_a_price_that_lifts_the_limit_on_the_cost_is_refused(price: str) -> None:
    sent, received = map(float, price.split(":"))
    with pytest.raises(SpecError, match="finite, non-negative"):
        Price(sent, received)
    with pytest.raises(ValidationError):
        LLMSettings(name="openai/m", price=(sent, received))


@given(st.sampled_from(["simulations", "tokens"]), st.one_of(st.integers(), st.floats()))
def test_a_number_of_things_is_whole_and_positive_or_refused(name: str, limit: float) -> None:
    if isinstance(limit, int) and limit >= 1:
        Budget(**{name: limit})
    else:
        with pytest.raises(SpecError, match=f"budget: {name}: expected a whole number, at least 1, got"):
            Budget(**{name: limit})  # type: ignore[arg-type]


@given(ANYTHING, ANYTHING, ANYTHING, ANYTHING)
def test_whatever_is_reported_the_usage_is_possible(
    sent: Any, received: Any, reasoning: Any, cost: Any
) -> None:
    reported = SimpleNamespace(
        prompt_tokens=sent,
        completion_tokens=received,
        completion_tokens_details=SimpleNamespace(reasoning_tokens=reasoning),
    )
    usage = usage_of(reported, llm="", request=REQUEST, text="a reply", price=None, reported_cost=cost)
    assert usage.prompt_tokens >= 0 and usage.completion_tokens >= 0
    assert usage.prompt_tokens + usage.completion_tokens > 0
    assert 0 <= usage.reasoning_tokens <= usage.completion_tokens
    assert usage.cost is None or 0 <= usage.cost < math.inf


def run(behaviour: Behaviour, **budget: Any) -> tuple[Result, int]:
    """Outcome of a run and the number of requests that it made."""
    problem = lag_problem()
    with misbehaving(behaviour) as server:
        chat = LiteLLMChat("openai/m", api_base=server.url, price=Price(1000.0, 1000.0))
        result = falsify(problem, LLMEngine(problem, chat, variant="MP4"), budget=Budget(**budget))
        return result, len(server.requests)


NEGATIVE = {"prompt_tokens": -1000, "completion_tokens": -1000, "total_tokens": -2000}


@pytest.mark.parametrize(("reported", "limit"), [({}, 130), (NEGATIVE, 1)])
def test_nothing_is_asked_again_beyond_the_limit_on_the_tokens(reported: dict[str, int], limit: int) -> None:
    result, requests = run(answers("no candidate", **reported), tokens=limit)
    assert (result.status, requests) == ("failed", 1)
    assert f"{limit} token" in result.reason
    assert result.spent.tokens > 0


def stated(value: str, **headers: str) -> float | None:
    """Seconds that are waited after a refusal with this Retry-After."""
    error = ConnectionError("busy")
    error.headers = {"retry-after": value, **headers}  # type: ignore[attr-defined]
    found = classify(error, llm="openai/m", api_base=None, secrets=())
    assert isinstance(found, TransientChatError)
    return found.retry_after


def test_a_number_is_taken_if_it_is_one_and_a_date_is_when_to_ask_again() -> None:
    assert [stated(value) for value in ("7", "-5", "nan", "inf")] == [7.0, 0.0, None, None]
    now = datetime.now(UTC)
    clock = format_datetime(now - timedelta(days=30), usegmt=True)
    later = format_datetime(now - timedelta(days=30, seconds=-70), usegmt=True)
    assert stated(later, date=clock) == 70.0, "by the server's clock"
    found = stated(format_datetime(now + timedelta(hours=10), usegmt=True))
    assert found is not None and 9 * 3600 < found <= 10 * 3600, "by this machine's"
