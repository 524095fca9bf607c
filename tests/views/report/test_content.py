import os
from dataclasses import replace
from html import unescape
from pathlib import Path

from falsifier.campaigns.analysis import load
from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.counterexamples.store import load_counterexample, save, to_store
from falsifier.engines import make_engine
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.shorthand import changes_from, changes_from_options
from falsifier.problem.source import ProblemSource
from falsifier.record import manifest
from falsifier.record.run import falsify
from falsifier.search.budget import Budget
from falsifier.search.request import LLMSettings, RunRequest
from falsifier.testing import lag_problem
from falsifier.views.report import markdown_report
from falsifier.views.report.content import gather
from falsifier.views.report.page import _runs, html_report
from falsifier.views.report.wording import run_command
from tests.campaigns.support import record_ad_hoc
from tests.problems import hard, mostly_broken
from tests.stepped import euler_problem


def test_the_heading_of_a_formula_without_a_name_is_the_formula(tmp_path: Path) -> None:
    record_ad_hoc(tmp_path, {"a": "G (y <= 5)", "b": "G (y <= 6)"})
    headings = [[s.heading for s in gather(place)[0].sections] for place in (tmp_path, tmp_path / "a")]
    assert headings == [["stl-1: G (y <= 5)", "stl-2: G (y <= 6)"], ["G (y <= 5)"]]
    assert "<h2>stl-2: G (y &lt;= 6) " in html_report(tmp_path)


def test_runs_of_the_same_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    places = [tmp_path / folder / "nightly" for folder in ("before", "after")]
    for place, budget in zip(places, (20, 30), strict=True):
        falsify(hard(), "uniform", budget=budget, directory=place)
    text = markdown_report(*places).replace("\\", "")
    assert "| --budget | 20 | 30 |" in text
    falsify(hard(), "uniform", budget=20, seed=1, directory=tmp_path / "after" / "weekly")
    assert "| HARD | uniform | 2/2 |" in markdown_report(tmp_path / "after"), "made in Python, too"
    for place in places:
        assert f"## HARD in {place}: violated" in text
        assert f"{place}: falsifier " in text, "its versions"


def test_versions_of_all_machines_are_told(tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        falsify(hard(), "uniform", budget=1, directory=tmp_path / name)
    known = manifest.read(tmp_path / "b")
    manifest.write(tmp_path / "b", known.model_copy(update={"platform": "<Node-7>"}))
    assert r"\<Node-7>" in markdown_report(tmp_path), "what others wrote is no markup"
    last = markdown_report(tmp_path).replace("\\", "").splitlines()[-1]
    assert [last.count(of) for of in (known.platform, "<Node-7>", "; falsifier ")] == [1, 1, 1]
    assert f"<dd>{known.platform}; &lt;Node-7&gt;</dd>" in html_report(tmp_path)


def test_real_inputs_are_drawn_as_they_were_and_not_as_whole_numbers(tmp_path: Path) -> None:
    falsify(lag_problem(), "uniform", budget=1, directory=tmp_path)
    output, given = gather(tmp_path)[0].sections[0].shown[0].panels
    assert (output.steps, given.steps, output.labels, given.labels) == (False, False, None, None)


def test_the_margin_is_told_of_violations_that_do_not_count_too(tmp_path: Path) -> None:
    problem = euler_problem("G[1,1] (x <= 0.65)")
    result = falsify(problem, make_engine("corners", problem, seed=0), budget=2, directory=tmp_path)
    assert (result.status, result.counterexample, result.refuted) == ("not falsified", None, ())
    assert [c.candidate.signals["u"].values for c in result.fragile] == [(1.0,) * 4]
    (tmp_path / "explanation.txt").write_text("Of the nearest miss.\n")
    for text in (markdown_report(tmp_path), html_report(tmp_path)):
        assert "was violated" in text and "Of the nearest miss." not in text
        assert "no violation confirmed in 2 simulations" in text.lower() and "violation found" not in text
        assert "-0.00132156 (violated by this margin)" in text.replace("\\", "").replace("−", "-")


def test_a_search_can_be_repeated_from_its_command() -> None:
    changes = changes_from_options(ranges=["u=0:1:3"], stop_time=5.0)
    request = RunRequest(
        problems=(ProblemSource(target="-my.toml:R", stl="x <= 1", changes=changes, context=("a.c",)),),
        engine="uniform",
        seed=3,
        budget=Budget(7, cost=0.5),
        jobs=2,
    )
    assert run_command(request) == (
        "falsifier run ./-my.toml:R --stl 'x <= 1' --search u=0:1:3 --stop-time 5.0 --context a.c --engine "
        "uniform --budget 7 --max-cost 0.5 --seed 3 --jobs 2"
    )
    source = ProblemSource(target="AT1", changes=changes_from(step_size=0.1))
    assert "no option states step_size" in run_command(request.model_copy(update={"problems": (source,)}))
    assert "my own" in run_command(request.model_copy(update={"engine": "my own"}))
    assert "known inputs" in run_command(request.model_copy(update={"start_from": ({},)}))
    free = ProblemSource(target="AT1", parameterization="free", shortest_piece=0.123456789)
    assert "--parameterization free:0.123456789 " in run_command(RunRequest(problems=(free,)))
    model = LLMSettings(
        name="openai/gpt-5-mini",
        effort="high",
        variant="MP4",
        price=(0.12345678, 2),
        anonymous=True,
        timeout=30,
        cache=False,
    )
    asked = RunRequest(problems=(ProblemSource(target="AT1"),), llm=model, budget=Budget(None, 9.0))
    assert run_command(asked) == (
        "falsifier run AT1 --llm openai/gpt-5-mini@high --variant MP4 --llm-option price=0.12345678:2 "
        "--llm-option timeout=30 --llm-option cache=no --anonymous --seconds 9.0 --seed 0"
    )


def test_how_long_slow_simulations_take_is_a_plain_number(tmp_path: Path) -> None:
    falsify(hard(), "uniform", budget=1, directory=tmp_path)
    (run,) = load(tmp_path)
    slow = replace(run, spent=replace(run.spent, simulation_seconds=1234.5))
    assert "simulation 1234.5, proposal" in _runs([slow])


def test_causes_of_failures_and_what_was_not_searched_are_in_every_report(tmp_path: Path) -> None:
    problem = lag_problem("G[0,10] (x <= 3)", response=mostly_broken, inputs=2)
    problem = replace(problem, space=replace(problem.space, inputs=problem.space.inputs[:1]))
    result = falsify(problem, "uniform", budget=12, seed=1, directory=tmp_path)
    for report in (html_report(tmp_path), markdown_report(tmp_path)):
        plain = unescape(report).replace("\\", "")
        assert result.failures[0].text in plain
        assert "not searched: v = 0 (not named beside what is searched" in plain
    assert "gain = 1" in html_report(tmp_path)


def test_the_shrunk_counterexample_and_its_explanation_are_shown_if_there_are_any(tmp_path: Path) -> None:
    original = falsify(hard(), "uniform", budget=20, directory=tmp_path).counterexample
    assert original is not None and original.evaluation.trajectory is not None
    before = gather(tmp_path)[0].sections[0].shown[0]
    assert not before.is_shrunk and not before.explanation
    assert f"falsifier explain {tmp_path} --shrink" in markdown_report(tmp_path)
    simpler = evaluate(hard(), Candidate({"u": Signal((0.0,), (1.0,))}))
    assert simpler.trajectory is not None and simpler.verdict is not None
    save(to_store(confirm(hard(), simpler)), tmp_path / "shrunk.json")
    simpler.trajectory.save(tmp_path / "shrunk.npz")
    assert f"To explain it: `falsifier explain {tmp_path}`" in markdown_report(tmp_path)
    (tmp_path / "explanation.txt").write_text("Because of u.\n")
    shown = gather(tmp_path)[0].sections[0].shown[0]
    assert shown.is_shrunk and shown.verdict == simpler.verdict and shown.candidate == simpler.candidate
    page = html_report(tmp_path)
    assert "The shrunk counterexample" in page and "Because of u." in page
    assert "falsifier explain" not in page
    text = markdown_report(tmp_path)
    assert "The shrunk counterexample:" in text
    assert all(f"falsifier replay {tmp_path / 'shrunk.json'}" in report for report in (page, text))
    found = load_counterexample(tmp_path)  # as if no simpler one had been found
    save(found, tmp_path / "shrunk.json")
    assert not gather(tmp_path)[0].sections[0].shown[0].is_shrunk, "the samples are those of another one"
    original.evaluation.trajectory.save(tmp_path / "shrunk.npz")
    assert "The counterexample, of which no simpler one was found nearby:" in markdown_report(tmp_path)
    shown = gather(tmp_path)[0].sections[0].shown[0]
    signal = shown.candidate.signals["u"]
    times = (*signal.times[:-1], signal.times[-1] + 1e-7)
    rounder = replace(shown.candidate, signals={"u": replace(signal, times=times)})
    assert replace(shown, candidate=rounder).what == "shrunk counterexample", "also by digits not shown"
    (tmp_path / "explanation.txt").write_bytes(b"Because \xff")
    assert "Because \N{REPLACEMENT CHARACTER}" in html_report(tmp_path)
    os.utime(tmp_path / "explanation.txt", (0, 0))
    assert not gather(tmp_path)[0].sections[0].shown[0].explanation, "the run went on since"
    (tmp_path / "shrunk.npz").write_bytes(b"damaged")
    assert not gather(tmp_path)[0].sections[0].shown[0].is_shrunk


def test_markdown_has_a_verdict_for_each_requirement_and_then_the_statistics(campaign: Path) -> None:
    text = markdown_report(campaign)
    assert text.startswith("# Falsification report: nightly\n")
    parts = [
        "## HARD: violated",
        "- what broke: x \\<= 0.6 was violated from ",
        "falsifier replay",
        "## NEVER: no violation found",
        "What was tried:",
        "What this does not show:",
        "| HARD | uniform | 2/2 |",
    ]
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    assert "`G[0,10] (x <= 0.6)`" in text
    assert "Robustness" not in text.partition("what broke")[0]
