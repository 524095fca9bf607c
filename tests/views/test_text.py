import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from falsifier.engines.llm import LLMEngine
from falsifier.llm.messages import ChatReply, Usage
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.problem import Problem
from falsifier.record.run import falsify, resume
from falsifier.search.budget import Spent
from falsifier.search.findings import Finding
from falsifier.search.result import Result
from falsifier.stl import Verdict
from falsifier.testing import lag_problem
from falsifier.views.report import html_report, markdown_report
from falsifier.views.text import margin_facts, result_json, result_text, results_text
from tests.fmu.fixtures import path
from tests.problems import conditional, easy, hard, impossible, mostly_broken, unusable
from tests.searches import stop_after


@pytest.fixture(scope="module")
def found() -> Result:
    return falsify(easy(), "corners", budget=10)


@pytest.fixture(scope="module")
def premise() -> Result:
    """A violation whose robustness is decided by its condition, which held."""
    return falsify(conditional(), start_from=[conditional().space.decode([0.95] * 4)], budget=1)


def test_a_counterexample_is_told_with_its_verdict_inputs_and_reason(found: Result) -> None:
    assert found.counterexample is not None
    lines = result_text(found).splitlines()
    assert lines[0].startswith(f"EASY: falsified after {found.spent.simulations} simulation")
    text = "\n".join(lines)
    values = ("G[0,10] (x <= 0.9)", "10 s", "x = 0.999973 m, u = 1 V", "u [V] constant 1", "extremes: u high")
    for part in (found.counterexample.reason, f"{found.robustness:+.6g}", *values):
        assert part in text
    assert "files" not in text, "nothing was recorded"


def test_values_that_decided_are_told_apart_from_their_limit() -> None:
    verdict = Verdict(-0.0005, 0.0, "x <= 1000000.0005", {"x": 1000000.001, "y": 1000000.001})
    assert dict(margin_facts(verdict, {}, {}))["values then"] == "x = 1000000.001, y = 1000000"


def test_items_are_told_with_their_names(tmp_path: Path) -> None:
    problem = Problem.from_fmu(path("Echo_2"), "G[0,1] (out_Enumeration <= 1)", stop_time=1.0)
    result = falsify(problem, "corners", budget=9, directory=tmp_path)
    for text in (result_text(result), markdown_report(tmp_path)):
        assert re.search(r"out_Boolean = . \((true|false)\), out_Enumeration = 3 \(third\)", text)


def test_the_unit_1_is_not_told(found: Result) -> None:
    assert found.shown is not None
    facts = dict(margin_facts(found.shown.verdict, {"x": "1", "u": "V"}, {}))
    assert facts["values then"] == "x = 0.999973, u = 1 V"


def test_without_a_counterexample_the_best_is_told_and_why_it_ended() -> None:
    result = falsify(impossible(), "uniform", budget=1)
    text = result_text(result)
    assert "not falsified after 1 simulation (" in text
    assert result.reason in text and "what broke" not in text
    assert f"{result.robustness:+.6g}" in text
    assert result_json(result)["best"]["breach"] is None


def test_a_run_that_can_be_continued_says_how(tmp_path: Path) -> None:
    result = falsify(impossible(), "uniform", budget=9, directory=tmp_path, listeners=stop_after(2))
    assert result.status == "interrupted"
    assert f"falsifier resume {shlex.quote(str(tmp_path))}" in result_text(result)
    before = replace(result, evaluations=())
    assert f"falsifier resume {shlex.quote(str(tmp_path))}" in result_text(before)


def test_what_the_language_model_used_is_told(found: Result) -> None:
    assert "language model" not in result_text(found)
    spent = Spent(simulations=1, calls=3, without_reply=1, prompt_tokens=90, completion_tokens=10, cost=0.25)
    text = result_text(replace(found, spent=spent))
    assert "3 requests (1 of them without a usable reply), 100 tokens" in text and "0.2500 US dollars" in text
    kept = result_text(replace(found, spent=Spent(simulations=1, kept=1)))
    assert "language model 0 requests, 1 reply from the cache, 0 tokens, 0.0000 US dollars" in kept
    unknown = result_text(replace(found, spent=replace(spent, cost=None)))
    assert "unknown" in unknown


def test_fragile_and_unconfirmed_violations_are_listed(found: Result) -> None:
    assert found.counterexample is not None
    fragile, refuted = (replace(found.counterexample, reason=r) for r in ("vanishes", "did not happen"))
    text = result_text(one := replace(found, fragile=(fragile,), refuted=(refuted,))) + results_text([one])
    assert text.count("vanishes") == text.count("did not happen") == 2


def test_several_results_are_a_line_each_with_notes_below(tmp_path: Path) -> None:
    results = falsify([impossible(), hard()], "corners", budget=5, directory=tmp_path)
    assert "png" not in results_text(results), "no picture was drawn"
    (tmp_path / "counterexample-HARD.png").touch()
    never, note, hard_line, broken, last = results_text(results).splitlines()
    assert never.startswith("NEVER  not falsified after 5")
    assert note.strip().startswith("note: Faster inputs were not tried")
    assert hard_line.startswith("HARD   falsified after")
    assert str(tmp_path / "counterexample-HARD.png") in hard_line
    assert broken.strip().startswith("x <= 0.6 was violated from ")
    assert last.startswith("1 of 2 falsified")


def test_what_broke_comes_before_what_decided(premise: Result) -> None:
    lines = result_text(premise).splitlines()
    told = [line.strip() for line in lines if "broke" in line or line.startswith(" " * 17)]
    assert told[0].startswith("what broke     x <= 0.5 was violated from 0.8 to 10 s: x = 0.94")
    assert told[1].startswith("while u >= 0.9 held (u = 0.95 V at 10 s)")
    order = [next(k for k, line in enumerate(lines) if text in line) for text in ("what broke", "decided by")]
    assert order == sorted(order)
    assert "decided by u >= 0.9" in lines[order[1]]
    told_json = result_json(premise)["counterexample"]
    assert told_json["predicate"] == "u >= 0.9"
    assert told_json["breach"]["text"] == "; ".join(line.removeprefix("what broke").strip() for line in told)
    assert told_json["breach"]["shortfalls"][0]["part"] == "x <= 0.5"


def test_a_line_of_several_says_if_a_part_was_not_tested(found: Result) -> None:
    finding = Finding(kind="condition", text="never held")
    partly = replace(found, status="not falsified", counterexample=None, findings=(finding,))
    last = replace(
        found, spent=Spent(simulations=9, seconds=12.34, simulation_seconds=10.0, engine_seconds=2.0)
    )
    lines = results_text([partly, last]).splitlines()
    assert "and a part of it was not tested, robustness" in lines[0]
    whole = "(12.3 s; simulator 10.00 s, engine 2.00 s)"
    assert lines[-1].endswith(whole), "the time of the whole run"


def test_the_time_of_searches_one_after_the_other_is_their_sum(tmp_path: Path) -> None:
    problems = [impossible(), lag_problem(points=2, name="APART")]
    results = falsify(problems, "corners", budget=1, directory=tmp_path)
    timed = [replace(r, spent=Spent(simulations=1, seconds=1.5)) for r in results]
    assert "(3.0 s; simulator" in results_text(timed) and "to continue" not in results_text(timed)
    stopped = [replace(timed[0], status="interrupted"), timed[1]]
    assert results_text(stopped).endswith(f"to continue: falsifier resume {tmp_path}")


def test_json_has_the_same_and_plain_values_only(found: Result) -> None:
    data = json.loads(json.dumps(result_json(found)))
    assert (data["requirement"], data["status"]) == ("EASY", "falsified")
    assert data["counterexample"]["robustness"] == found.robustness
    assert data["spent"]["simulations"] == found.spent.simulations
    assert data["directory"] is None
    unusable_ = falsify(unusable(), "uniform", budget=20)
    failed = json.loads(json.dumps(result_json(unusable_)))
    assert (failed["counterexample"], failed["best"]) == (None, None)
    text = result_text(unusable_)
    assert "out of order" in text and "robustness" not in text


def test_random_changes_in_place_of_answers_are_told_with_the_reason(tmp_path: Path) -> None:
    chat = ScriptedChat(lambda _: "nothing")
    run = tmp_path / "run"
    result = falsify(impossible(), LLMEngine(impossible(), chat), budget=1, directory=run)
    remark = "of 1 sample, 1 drawn at random, because scripted gave no valid reply in 3"
    (line,) = (x for x in result_text(result).splitlines() if remark in x)
    assert line.startswith("  note ")
    assert remark in results_text([result])
    assert remark in result_json(result)["remarks"][0]
    # A resumed run counts what is recorded too.
    again = LLMEngine(impossible(), chat)
    (resumed,) = resume(run, problems=[impossible()], engine=again, budget=2)
    both = "of 2 samples, 1 drawn at random and 1 from random changes of the best sample, because scripted"
    assert resumed.remarks[0].startswith(both)


def test_why_simulations_failed_and_what_was_not_searched_is_told() -> None:
    problem = lag_problem("G[0,10] (x <= 3)", response=mostly_broken, inputs=2)
    space = replace(problem.space, inputs=problem.space.inputs[:1])
    problem = replace(problem, space=space, parameters={"bias": 0.25})
    result = falsify(problem, "uniform", budget=20, seed=1)
    (cause,) = result.failures
    assert cause.count == result.spent.failed > 1 and not result.evaluations[cause.simulation - 1].verdict
    for text in (result_text(result), results_text([result, replace(result, problem=problem)])):
        assert cause.text in text
        assert "v = 0 (not named beside what is searched" in text
        assert "bias" not in text  # nobody expects a parameter without a range to be searched
    data = result_json(result)
    assert data["failures"][0]["count"] == cause.count
    held = {each["name"]: each["value"] for each in data["not_searched"]}
    assert (held["v"], held["bias"]) == (0.0, 0.25)


def test_what_several_results_asked_together_is_told_once(tmp_path: Path) -> None:
    usage = Usage(prompt_tokens=100, completion_tokens=50, cost=0.15)
    chat = ScriptedChat(lambda _: ChatReply(text='{"point": [0.1, 0.2, 0.3, 0.4]}', usage=usage))
    problems = [impossible(), lag_problem("G[0,10] (x <= 60)", points=4, name="OTHER")]
    results = falsify(problems, llm=chat, budget=1, directory=tmp_path)
    line = "anguage model: 1 request, 150 tokens, 0.1500 US dollars"
    assert results_text(results).count(f"\nl{line}") == 1
    assert f"\n\nL{line}.\n" in markdown_report(tmp_path)
    assert f"l{line}, started " in html_report(tmp_path)
    assert "anguage model" not in results_text([replace(r, spent=Spent(simulations=1)) for r in results])
