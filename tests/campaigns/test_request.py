import pytest

from falsifier.campaigns import CampaignRequest, Method, cross, method_of, run_name
from falsifier.errors import SpecError
from falsifier.problem.source import ProblemSource
from falsifier.search.budget import Budget
from falsifier.search.request import LLMSettings

AT1 = ProblemSource(target="AT1")


def test_a_campaign_is_requirements_times_methods_times_seeds() -> None:
    methods = [Method("uniform"), Method(llm="openai/gpt-5-nano", effort="low", variant="MP4")]
    runs = cross(
        [AT1, ProblemSource(target="my.toml:R")],
        methods,
        seeds=range(3),
        budget=Budget(7),
        asking=LLMSettings(name="", api_base="http://x", options={"top_p": 0.5}, cache=False),
    )
    assert len(runs) == 12
    assert [r.seed for r in runs[:3]] == [0, 1, 2]
    assert [method_of(r) for r in runs] == [m for _ in range(2) for m in methods for _ in range(3)]
    assert runs[3].llm == LLMSettings(
        name="openai/gpt-5-nano",
        effort="low",
        api_base="http://x",
        variant="MP4",
        options={"top_p": 0.5},
        cache=False,
    )
    assert {r.problems[0].parameterization for r in runs} == {"fixed"}
    assert {r.budget for r in runs} == {Budget(7)}


def test_names_are_readable_and_differ_with_anything_that_matters() -> None:
    def name(method: Method, seed: int = 0, budget: int = 5, target: str = "specs/AT.toml:AT1") -> str:
        problem = ProblemSource(target=target)
        return run_name(cross([problem], [method], seeds=[seed], budget=Budget(budget))[0])

    base = name(Method("uniform"))
    assert base.startswith("AT1-uniform-0-")
    others = {
        name(Method("sobol")),
        name(Method("uniform", parameterization="free")),
        name(Method("uniform", profile="instance2")),
        name(Method("uniform"), seed=1),
        name(Method("uniform"), budget=6),
        name(Method("uniform"), target="other/AT.toml:AT1"),
    }
    assert len(others | {base}) == 7
    assert name(Method("uniform")) == base
    unsafe = name(Method(llm="ollama_chat/gpt-oss:20b", variant="MP4"))
    assert unsafe.startswith("AT1-gpt-oss-20b-MP4-0-")


def test_free_and_fixed_parameterizations_are_different_methods() -> None:
    fixed, free = Method("uniform"), Method("uniform", parameterization="free")
    assert fixed != free
    assert (fixed.label, free.label) == ("uniform", "uniform, free")
    assert Method("hybrid", "openai/gpt-5-mini", "high", "MP4", "fixed", "instance2").label == (
        "hybrid + gpt-5-mini high MP4, instance2"
    )
    named = Method(llm="openai/gpt-5-mini", anonymous=True, fallback="surrogate")
    assert named.label == "gpt-5-mini, neutral names, fallback surrogate"
    assert method_of(cross([AT1], [named], seeds=[0], budget=Budget(1))[0]) == named


def test_the_same_run_twice_is_refused() -> None:
    run = cross([AT1], [Method("uniform")], seeds=[0], budget=Budget(5))
    with pytest.raises(SpecError, match="the same run twice"):
        CampaignRequest(runs=run + run).named()
