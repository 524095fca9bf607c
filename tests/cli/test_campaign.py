import json
from pathlib import Path
from typing import Any

import pytest

from falsifier.context.values import Crossing
from falsifier.errors import SpecError
from falsifier.record import manifest
from falsifier.record.run import falsify
from falsifier.testing import lag_problem
from tests.cli.support import HARD, NEVER, bench
from tests.command import falsifier
from tests.problems import mostly_broken


def test_bench_prints_and_saves_the_tables(command: Any, tmp_path: Path) -> None:
    result = bench(command, "--out", "c", code=0)
    assert result.stdout.startswith("Falsification\n")
    assert "HARD" in result.stdout
    assert "4 runs in c\nuniform: fixed parameterization\n" in result.stderr
    assert "[4/4]" in result.stderr
    assert "| HARD | uniform | 2/2 |" in (tmp_path / "c" / "table-main.md").read_text()
    assert (tmp_path / "c" / "table-main.csv").read_text().startswith("requirement,method,FR")
    assert not (tmp_path / "c" / "table-ablation.md").exists()
    rows = json.loads((tmp_path / "c" / "table.json").read_text())
    assert [(row["requirement"], row["falsified_runs"]) for row in rows] == [("HARD", 2), ("NEVER", 0)]
    alone = json.loads(bench(command, "--json", "--quiet").stdout)
    assert [row["label"] for row in alone] == ["uniform", "uniform"]


@pytest.mark.parametrize("limit", [("--max-cost", "1"), ("--total", "cost=1")])
def test_a_cost_that_cannot_be_known_is_not_limited(limit: tuple[str, str], tmp_path: Path) -> None:
    asked = ("--llm", "hosted_vllm/x", "--api-base", "http://127.0.0.1:9", "--yes", "--out", "c", *limit)
    done = falsifier("bench", NEVER, "--runs", "1", *asked, cwd=tmp_path)
    told = "limit the tokens, or state it where the run or campaign is started (--llm-option price="
    assert (done.code, told in done.err) == (2, True), done.err
    assert "limited to" not in done.err and not (tmp_path / "c").exists()


def test_a_table_that_is_too_wide_for_the_terminal_shows_the_columns_that_fit(
    command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = bench(command, "--out", "c", "--quiet").stdout.splitlines()
    monkeypatch.setattr("click.testing._NamedTextIOWrapper.isatty", lambda _: True)
    monkeypatch.setenv("COLUMNS", "60")
    cut = command("resume", "c", "--quiet")
    lines = cut.stdout.splitlines()
    assert max(map(len, lines[:5])) <= 60 < max(map(len, whole[:5]))
    assert whole[2].startswith(lines[2])
    assert "too wide for this terminal: " in cut.stderr and "; in c/table-main.md" in cut.stderr


def test_bench_reads_and_records_context_files(command: Any, tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text("void f(double throttle) { if (throttle > 37.5) speed = 1; }\n")
    asked = ("bench", "AT1", "--runs", "1", "--budget", "1", "--quiet")
    command(*asked, "--context", "a.c", "--out", "c", code=0)
    (place,) = (tmp_path / "c").rglob("manifest.json")
    assert manifest.read(place.parent).contexts["AT1"].crossings == (Crossing("throttle", 37.5),)
    missing = command(*asked, "--context", "b.c", "--out", "d")
    assert isinstance(missing.exception, SpecError)
    assert "context b.c: cannot be read" in str(missing.exception)
    assert missing.stderr == "" and not (tmp_path / "d").exists(), "nothing was announced or written"
    useless = command(*asked, "--context", "a.c", "--engine", "uniform", "--out", "e")
    assert "--context: applies to language models and" in f"{useless.stderr} {useless.exception}"


def test_a_stopped_campaign_says_how_to_go_on_and_a_complete_one_is_not_stopped(
    command: Any, tmp_path: Path
) -> None:
    stopped = bench(command, "--out", "c", "--total", "simulations=1", code=3)
    rates = [line.split("  ")[:3] for line in stopped.stdout.splitlines()[4:6]]
    assert rates[1] == ["impossible", " uniform", "0/0 +2"], "no run of it has begun"
    assert "the budget of 1 simulation is used up" in stopped.stderr
    assert "falsifier resume c" in stopped.stderr
    command("resume", "c", "--total", "simulations=1000", "--quiet", code=0)
    assert "to continue" not in command("resume", "c", "--total", "simulations=5", "--quiet", code=0).stderr
    rows = json.loads((tmp_path / "c" / "table.json").read_text())
    assert [(row["requirement"], row["falsified_runs"]) for row in rows] == [("HARD", 2), ("NEVER", 0)]


@pytest.fixture
def requested(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The requests of campaigns, which are not carried out."""
    seen: list[Any] = []

    def record(request: Any, *_: object, **__: object) -> None:
        seen.append(request)
        raise SpecError("seen")

    monkeypatch.setattr("falsifier.cli.campaign.check_request", lambda *_, **__: None)
    monkeypatch.setattr("falsifier.cli.campaign.run_campaign", record)
    return seen


def test_methods_are_all_combinations(command: Any, requested: list[Any]) -> None:
    done = command(
        *("bench", "AT1", HARD, "--runs", "1", "--seed", "5", "--max-cost", "2", "--total", "cost=9"),
        *("--llm", "openai/gpt-5-nano@low", "--llm", "x/y@2024@high", "--llm-option", "price=1:2"),
        *("--variant", "MP4", "--variant", "MP5", "--anonymous"),
        *("--parameterization", "fixed", "--parameterization", "free"),
    )
    (request,) = requested
    asked = {(r.llm.name, r.llm.effort, r.llm.variant, r.problems[0].parameterization) for r in request.runs}
    # With a prompt or a problem that offers no control points to choose, the fixed ones are searched once.
    assert (len(asked), len(request.runs)) == (6, 10)
    assert "openai/gpt-5-nano low MP5, neutral names: free parameterization of AT1\n" in done.stderr
    assert ("openai/gpt-5-nano", "low", "MP5", "free") in asked
    assert ("x/y@2024", "high", "MP4", "fixed") in asked
    assert {(r.seed, r.budget.cost, r.budget.simulations) for r in request.runs} == {(5, 2.0, 100)}
    assert request.limits.cost == 9.0
    assert {(r.llm.price, r.llm.anonymous) for r in request.runs} == {((1.0, 2.0), True)}


def test_engines_that_ask_no_language_model_run_beside_those_that_do(
    command: Any, requested: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_BASE", "http://me:word@127.0.0.1:9")
    engines = ("--engine", "llm", "--engine", "uniform", "--engine", "hybrid")
    done = command("bench", HARD, "--runs", "1", *engines, "--llm", "openai/y", "--llm", "x/z")
    (request,) = requested
    y, z = "openai/y at http://127.0.0.1:9", "x/z"  # which has an address of its own
    asked = [(r.engine, r.llm and r.llm.told) for r in request.runs]
    assert asked == [("llm", y), ("llm", z), ("uniform", None), ("hybrid", y), ("hybrid", z)]
    assert f"questions to {y}, {z}; the price is unknown" in done.stderr


def test_a_language_model_that_no_engine_asks_is_refused(tmp_path: Path) -> None:
    engines = ("--engine", "uniform", "--engine", "corners", "--llm", "hosted_vllm/x")
    done = falsifier(
        "bench", NEVER, *engines, "--api-base", "http://127.0.0.1:9", "--out", "c", cwd=tmp_path, code=2
    )
    assert "does not use a language model" in done.err


def test_suites_and_instances(command: Any, requested: list[Any]) -> None:
    command("bench", "--suite", "arch-comp", "--engine", "uniform")
    command("bench", "--suite", "arch-comp", "--parameterization", "instance2", "--engine", "uniform")
    command("bench", "AT1", "--engine", "surrogate")
    first, second, plain = requested
    # A suite is run as the competition does; other targets as falsifier run would.
    for request, budget, parameterization in ((first, 1500, "fixed"), (plain, 100, "free")):
        assert {r.budget.simulations for r in request.runs} == {budget}
        assert {r.problems[0].parameterization for r in request.runs} == {parameterization}
    assert (len(first.runs), len(second.runs)) == (210, 200)
    assert {r.problems[0].profile for r in first.runs} == {None}
    assert {r.problems[0].profile for r in second.runs} == {"instance2"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bench"], "expected either TARGETS (requirements or specs)"),
        (["bench", HARD, "--suite", "arch-comp"], "expected either TARGETS (requirements or specs)"),
        (["bench", HARD, "--parameterization", "free:1"], "applies to single runs only"),
        (["bench", HARD, "--variant", "MP1"], "--variant: requires --llm"),
        (["bench", HARD, "--engine", "uniform", "--table", "llms"], "--table llms: shows language models"),
    ],
)
def test_wrong_usage_is_said(command: Any, arguments: list[str], message: str) -> None:
    assert message in command(*arguments, code=2).stderr


def test_watch_follows_single_runs_too(command: Any, tmp_path: Path) -> None:
    command("run", NEVER, "--engine", "uniform", "--budget", "5", "--out", "r/a", "--quiet")
    falsify([lag_problem(), lag_problem("G[0,5] (x <= 50)", name="other")], budget=3, directory="r/b")
    result = command("watch", "r/a", code=0)
    assert "not falsified after 5 simulations, best robustness" in result.stdout
    assert "1/1 run finished, 0 falsified, 5 simulations" in result.stdout
    journal = tmp_path / "r" / "a" / "journal.jsonl"
    journal.write_text("".join(journal.read_text().splitlines(keepends=True)[:-1]))  # as after a kill
    result = command("watch", "r")
    assert "LAG surrogate, shared search seed 0: " in result.stdout
    assert "2/3 runs finished, 1 falsified, 8 simulations" in result.stdout
    assert "stopped; to continue: falsifier resume r" in result.stdout


def test_watch_continues_nothing_that_most_failed_simulations_have_ended(command: Any) -> None:
    falsify(lag_problem(response=mostly_broken), "uniform", budget=20, directory="r")
    assert "failed after 20 simulations" in (out := command("watch", "r").stdout) and "stopped" not in out
    never = lag_problem("G (1/(x-x) <= 50)", name="never judged")
    falsify([lag_problem("G (x <= 99)"), never], "uniform", budget=3, directory="s")
    out = command("watch", "s").stdout
    assert "3 of 3 simulations could not be judged" in out and "stopped" not in out


def test_watch_ends_where_nobody_works_on(command: Any, tmp_path: Path) -> None:
    bench(command, "--out", "c", "--quiet")
    ended = command("watch", "c").stdout
    assert "4/4 runs finished, 2 falsified" in ended and "stopped" not in ended
    for journal in sorted((tmp_path / "c" / "runs").rglob("journal.jsonl"))[:2]:
        journal.write_text("".join(journal.read_text().splitlines(keepends=True)[:-2]))  # as after a kill
    stopped = command("watch", "c").stdout
    assert "2/4 runs finished" in stopped and "running" not in stopped
    assert "stopped; to continue: falsifier resume c" in stopped


def test_a_campaign_as_a_user_starts_it(tmp_path: Path) -> None:
    """In processes of its own, with real workers."""
    done = falsifier(
        *("bench", HARD, "--engine", "corners", "--runs", "2", "--budget", "5", "--jobs", "2", "--out=a c"),
        cwd=tmp_path,
        code=0,
    )
    assert "2/2" in done.out and "HARD" in done.out and "2 runs in a c" in done.err
    again = falsifier("bench", HARD, "--engine", "corners", "--out", "a c", cwd=tmp_path, code=2)
    assert "falsifier resume 'a c'" in again.err and "runs in" not in again.err
