"""Who leads a search, from the names that a user gives."""

from dataclasses import replace
from pathlib import Path

import pytest

from falsifier.context.values import Context, Crossing, Named
from falsifier.engines.hybrid import Hybrid
from falsifier.engines.llm import LLMEngine
from falsifier.errors import SpecError
from falsifier.llm.scripted import ScriptedChat
from falsifier.search.budget import Budget
from falsifier.search.make_engines import check_names, make_engines, told_problems
from falsifier.search.request import LLMSettings, RunRequest
from falsifier.testing import lag_problem

PROBLEM = lag_problem()
PROBLEMS = [lag_problem(name="A"), lag_problem(name="B")]
CHAT = ScriptedChat([], llm="script")
BASE = "http://127.0.0.1:9"


def request(engine: str | None = None, llm: str | None = None, **settings: object) -> RunRequest:
    named = LLMSettings(name=llm, api_base=BASE, **settings) if llm else None
    return RunRequest(problems=(), engine=engine, llm=named, seed=3)


def test_without_names_the_default_engine_leads() -> None:
    (engine,) = make_engines(request(), [PROBLEM], None)
    assert engine.name == "surrogate"


def test_a_language_model_alone_leads_and_with_the_hybrid_advises() -> None:
    (llm,) = make_engines(request(llm="script", variant="MP4"), [PROBLEM], CHAT)
    assert isinstance(llm, LLMEngine) and llm.name == "script MP4"
    (hybrid,) = make_engines(request("hybrid", "script"), [PROBLEM], CHAT)
    assert isinstance(hybrid, Hybrid)


def test_several_requirements_have_engines_that_draw_different_points() -> None:
    one, other = make_engines(request("uniform"), PROBLEMS, None)
    (alone,) = make_engines(request("uniform"), PROBLEMS[:1], None)
    assert one.ask()[0].key == alone.ask()[0].key
    assert one.ask()[0].key != other.ask()[0].key


@pytest.mark.parametrize(
    ("engine", "llm", "settings", "named"),
    [
        ("corner", None, {}, "'corners'"),
        ("llm", None, {}, "llm=NAME"),
        ("hybrid", None, {}, "llm=NAME"),
        ("uniform", "script", {}, "uniform"),
        (None, "script", {"variant": "MP9"}, "MP9"),
    ],
)
def test_names_that_do_not_go_together_are_refused_before_anything_is_made(
    engine: str | None, llm: str | None, settings: dict[str, str], named: str
) -> None:
    with pytest.raises(SpecError, match=named):
        made = request(engine, llm, **settings)
        check_names(made.engine, made.llm)


def test_a_limit_on_money_needs_a_price() -> None:
    asked = request(llm="hosted_vllm/mine").model_copy(update={"budget": Budget(cost=1.0)})
    with pytest.raises(SpecError, match=r"price=\(SENT, RECEIVED\)"):
        make_engines(asked, [PROBLEM], None)
    priced = LLMSettings(name="hosted_vllm/mine", api_base=BASE, price=(0.25, 2.0), cache=False)
    (engine,) = make_engines(asked.model_copy(update={"llm": priced}), [PROBLEM], None)
    assert engine.name.startswith("hosted_vllm/mine")


def test_the_client_is_loaded_before_a_time_limit_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded: list[str] = []
    monkeypatch.setattr("falsifier.llm.litellm_adapter.load_litellm", lambda: loaded.append("litellm"))
    for budget, so_far in ((Budget(), []), (Budget(seconds=3.0), ["litellm"])):
        make_engines(request(llm="hosted_vllm/mine").model_copy(update={"budget": budget}), [PROBLEM], None)
        assert loaded == so_far


def test_several_requirements_of_one_language_model_fall_back_to_different_points() -> None:
    hybrids = make_engines(request("hybrid", "script"), PROBLEMS, CHAT)
    surrogates = [hybrid.surrogate for hybrid in hybrids if isinstance(hybrid, Hybrid)]
    one, other = ([candidate.key for candidate in each.ask(12)] for each in surrogates)
    assert one != other


def test_the_surrogate_alone_reads_levels_and_what_is_recorded_is_not_read_again(tmp_path: Path) -> None:
    (source := tmp_path / "a.mo").write_text(
        "model A\n input Real u;\n output Real x;\nequation\n x = if u > 0.25 then 1 else 0;\nend A;\n"
        "// password: not so secret, and sent nowhere\n"
    )
    problem = replace(PROBLEM, named_context=Named((str(source),)))
    (read,) = told_problems(request(), [problem])
    assert read.context == Context(crossings=(Crossing(PROBLEM.space.inputs[0].name, 0.25),))
    source.unlink()
    assert told_problems(request("cma"), [problem])[0].context == Context()
    (recorded,) = told_problems(request(), [problem], {problem.name: read.context})
    assert recorded.context == read.context
    assert told_problems(request(), [problem], {})[0].context == Context()  # it told nothing
    with pytest.raises(SpecError, match="cannot be read"):
        told_problems(request(), [problem])
