from pathlib import Path
from typing import Any

import pytest

from falsifier.campaigns.directory import CampaignRecord, write_campaign
from falsifier.campaigns.request import CampaignRequest, Searcher, ceiling, cross
from falsifier.campaigns.runner import check_request, resume_campaign, run_campaign
from falsifier.errors import SpecError
from falsifier.llm.prompts import MOST_PROMPT_TOKENS
from falsifier.llm.usage import Price
from falsifier.problem.loading import note_named
from falsifier.problem.source import ProblemSource
from falsifier.record.manifest import environment
from falsifier.search.budget import Budget
from falsifier.search.make_engines import note_llm, price_of
from falsifier.search.request import LLMSettings

PAID = LLMSettings(name="openai/m")
TARGET = [ProblemSource(target="python:tests.problems:easy")]


def asked(*searchers: Searcher, limits: Budget | None = None, cost: float | None = None) -> CampaignRequest:
    runs = cross(TARGET, searchers, seeds=range(2), budget=Budget(10, cost=cost))
    return CampaignRequest(runs=runs, limits=limits)


def price(llm: LLMSettings) -> Price | None:
    return Price(0.5, 2.0) if llm.name == "openai/m" else None


def test_without_a_language_model_there_is_nothing_to_say() -> None:
    assert ceiling(asked("uniform"), price) is None


def test_the_most_is_every_question_three_times_at_full_length() -> None:
    most = ceiling(asked(PAID, "uniform"), price)
    assert most is not None
    assert most.cost == pytest.approx(60 * MOST_PROMPT_TOKENS * 0.5 / 1e6)
    assert "up to 60 questions" in most.text and "costs about 0.48 US dollars" in most.text


def test_limits_go_before_estimates() -> None:
    for request in (asked(PAID, cost=0.1), asked(PAID, limits=Budget(None, cost=0.2))):
        most = ceiling(request, price)
        assert most is not None
        assert "limited to 0.2 US dollars" in most.text


def test_an_unknown_price_is_not_zero() -> None:
    most = ceiling(asked(PAID, LLMSettings(name="hosted_vllm/x")), price)
    assert most is not None and most.cost is None and "the price is unknown" in most.text
    free = ceiling(asked(PAID), lambda llm: Price(0.0, 0.0))
    assert free is not None and free.cost == 0 and "free of charge" in free.text


def test_the_listed_price_is_not_that_of_another_server() -> None:
    listed = LLMSettings(name="openai/gpt-5-mini")
    elsewhere = listed.model_copy(update={"api_base": "http://127.0.0.1:9"})
    assert price_of(listed) is not None
    assert price_of(elsewhere) is None
    assert price_of(elsewhere.model_copy(update={"price": (1.0, 2.0)})) == Price(1.0, 2.0)


@pytest.mark.parametrize(
    "limits", [{"cost": 0.5}, {"limits": Budget(None, cost=0.5)}, {"cost": 0.5, "limits": Budget(9)}]
)
def test_a_cost_that_cannot_be_known_is_not_limited(limits: dict[str, Any], tmp_path: Path) -> None:
    unknown = LLMSettings(name="hosted_vllm/x", api_base="http://127.0.0.1:9")
    with pytest.raises(SpecError, match=r"the price of hosted_vllm/x is unknown.*started \(price="):
        run_campaign(asked(unknown, **limits), tmp_path / "c")
    assert not (tmp_path / "c").exists()
    check_request(asked(unknown.model_copy(update={"price": (1.0, 2.0)}), **limits))


def test_a_resumed_campaign_is_not_given_a_limit_that_cannot_hold(tmp_path: Path) -> None:
    unknown = LLMSettings(name="hosted_vllm/x", api_base="http://127.0.0.1:9")
    record = CampaignRecord(**environment(), request=asked(unknown), hashes={})
    write_campaign(tmp_path, record)
    note_llm(unknown)
    note_named(record.request.runs[0].problems[0])
    with pytest.raises(SpecError, match="the price of hosted_vllm/x is unknown"):
        resume_campaign(tmp_path, limits=Budget(None, cost=0.5))
