import pytest

from falsifier.campaigns import CampaignRequest, Method, cross, method_of, run_name
from falsifier.errors import SpecError
from falsifier.problem.source import ProblemSource
from falsifier.search.budget import Budget
from falsifier.search.request import LLMSettings, RunRequest

AT1 = ProblemSource(target="AT1")
NANO = LLMSettings(name="openai/gpt-5-nano", effort="low", variant="MP4")


def test_a_campaign_is_requirements_times_searchers_times_seeds() -> None:
    mine = ProblemSource(target="my.toml:R", parameterization="fixed")
    runs = cross([AT1, mine], ["uniform", NANO, ("hybrid", NANO)], seeds=range(3), budget=Budget(7))
    assert len(runs) == 18
    assert [r.seed for r in runs[:3]] == [0, 1, 2]
    assert [(r.engine, r.llm) for r in runs[::3]] == 2 * [("uniform", None), (None, NANO), ("hybrid", NANO)]
    assert {r.budget for r in runs} == {Budget(7)}
    # An engine that never chooses control points is not said to have done so.
    kinds = [r.problems[0].parameterization for r in runs[::3]]
    assert kinds == ["fixed", "fixed", "free", "fixed", "fixed", "fixed"]
    assert cross([AT1, AT1], ["uniform"], seeds=range(2), budget=7) == runs[:2]
    # Names of directories are made of what a request states: what it leaves out must not change them.
    assert '"record"' not in runs[0].model_dump_json()
    with pytest.raises(SpecError, match="the same run twice"):
        CampaignRequest(runs=runs[:1] * 2).named()
    closed = ProblemSource(target="python:tests.problems:hard")
    both = [closed, closed.model_copy(update={"parameterization": "fixed"})]
    assert [r.problems for r in cross(both, ["surrogate"], seeds=[0], budget=Budget(7))] == [(both[1],)]


def test_names_are_readable_and_differ_with_anything_that_matters() -> None:
    def name(searcher: str | LLMSettings = "surrogate", seed: int = 0, budget: int = 5, **source: str) -> str:
        problem = ProblemSource.model_validate({"target": "specs/AT.toml:AT1"} | source)
        who = {"engine": searcher} if isinstance(searcher, str) else {"llm": searcher}
        asked = {"problems": (problem,), "seed": seed, "budget": Budget(budget)}
        return run_name(RunRequest.model_validate(asked | who))

    base = name()
    assert base.startswith("AT1-surrogate-free-0-")
    others = {
        name("uniform"),
        name(parameterization="fixed"),
        name(profile="instance2"),
        name(seed=1),
        name(budget=6),
        name(target="other/AT.toml:AT1"),
    }
    assert len(others | {base}) == 7
    assert name() == base
    unsafe = name(LLMSettings(name="ollama_chat/gpt-oss:20b", variant="MP4"), parameterization="fixed")
    assert unsafe.startswith("AT1-gpt-oss-20b-MP4-0-"), "as in campaigns that exist"
    assert name(target="specs/AT.toml:Öl druck").startswith("Öl-druck-surrogate-free-0-")


def test_free_and_fixed_parameterizations_are_different_methods() -> None:
    fixed, free = Method("uniform"), Method("uniform", parameterization="free")
    assert fixed != free
    assert (fixed.label, free.label) == ("uniform", "uniform, free")
    assert Method("hybrid", "openai/gpt-5-mini", "high", "MP4", "fixed", "instance2").label == (
        "hybrid + openai/gpt-5-mini high MP4, instance2"
    )
    named = LLMSettings(name="openai/gpt-5-mini", anonymous=True)
    (run,) = cross([AT1], [named], seeds=[0], budget=Budget(1))
    assert method_of(run).label == "openai/gpt-5-mini, free, neutral names"
