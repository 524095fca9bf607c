import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from falsifier.campaigns.directory import locked
from falsifier.cli import cli
from falsifier.errors import SpecError
from tests.campaigns.support import work_in_threads
from tests.command import falsifier

HARD, NEVER = "python:tests.problems:hard", "python:tests.problems:impossible"


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Call a command in this process, with threads for workers."""
    work_in_threads(monkeypatch)
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> Result:
        return CliRunner().invoke(cli, [str(a) for a in arguments])

    return call


def bench(command: Any, *more: str) -> Result:
    result: Result = command(
        "bench", HARD, NEVER, "--engine", "uniform", "--runs", "2", "--budget", "20", *more
    )
    return result


def test_bench_prints_and_saves_the_tables(command: Any, tmp_path: Path) -> None:
    result = bench(command, "--out", "c")
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("Falsification\n")
    assert "HARD" in result.stdout
    assert "4 runs in c" in result.stderr
    assert "[4/4]" in result.stderr
    assert "| HARD | uniform | 2/2 |" in (tmp_path / "c" / "table-main.md").read_text()
    assert (tmp_path / "c" / "table-main.csv").read_text().startswith("requirement,method,FR")
    assert not (tmp_path / "c" / "table-ablation.md").exists()
    rows = json.loads((tmp_path / "c" / "table.json").read_text())
    assert [(row["requirement"], row["falsified"]) for row in rows] == [("HARD", 2), ("NEVER", 0)]


def test_json_is_alone_on_stdout(command: Any) -> None:
    result = bench(command, "--json", "--quiet")
    assert [row["label"] for row in json.loads(result.stdout)] == ["uniform", "uniform"]


def test_a_stopped_campaign_says_how_to_go_on(command: Any, tmp_path: Path) -> None:
    stopped = bench(command, "--out", "c", "--total-budget", "5")
    assert stopped.exit_code == 3
    assert "the budget of 5 simulations is used up" in stopped.stderr
    assert "falsifier resume c" in stopped.stderr
    resumed = command("resume", "c", "--total-budget", "1000", "--quiet")
    assert resumed.exit_code == 0, resumed.output
    whole = bench(command, "--out", "whole", "--quiet")
    times = {"simulation_seconds", "seconds"}
    tables = [
        [
            {k: v for k, v in row.items() if k not in times}
            for row in json.loads((tmp_path / d / "table.json").read_text())
        ]
        for d in ("c", "whole")
    ]
    assert tables[0] == tables[1]
    assert whole.exit_code == 0


def test_methods_are_all_combinations(command: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []

    def record(request: Any, *_: object, **__: object) -> None:
        seen.append(request)
        raise SpecError("seen")

    monkeypatch.setattr("falsifier.cli.campaign.run_campaign", record)
    command(
        *(
            "bench",
            HARD,
            "--runs",
            "1",
            "--seed",
            "5",
            "--max-cost",
            "2",
            "--total-cost",
            "9",
            "--calls",
            "3",
        ),
        *("--llm", "openai/gpt-5-nano@low", "--llm", "x/y@2024", "--effort", "high", "--price", "1:2"),
        *("--variant", "MP1", "--variant", "MP4", "--anonymous"),
        *("--parameterization", "fixed", "--parameterization", "free"),
    )
    (request,) = seen
    asked = {(r.llm.name, r.llm.effort, r.llm.variant, r.problems[0].parameterization) for r in request.runs}
    assert len(asked) == len(request.runs) == 8
    assert ("openai/gpt-5-nano", "low", "MP1", "free") in asked
    assert ("x/y@2024", "high", "MP4", "fixed") in asked
    assert {(r.seed, r.budget.cost, r.budget.simulations) for r in request.runs} == {(5, 2.0, 1500)}
    assert (request.limits.cost, request.calls) == (9.0, 3)
    assert {(r.llm.price, r.llm.anonymous) for r in request.runs} == {((1.0, 2.0), True)}


def test_suites_and_instances(command: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []

    def record(request: Any, *_: object, **__: object) -> None:
        seen.append(request)
        raise SpecError("seen")

    monkeypatch.setattr("falsifier.cli.campaign.run_campaign", record)
    command("bench", "--suite", "arch-comp", "--engine", "uniform")
    command("bench", "--suite", "arch-comp", "--instance", "2", "--engine", "uniform")
    first, second = seen
    assert (len(first.runs), len(second.runs)) == (210, 200)
    assert {r.problems[0].profile for r in first.runs} == {None}
    assert {r.problems[0].profile for r in second.runs} == {"instance2"}
    assert first.suite == "arch-comp"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bench"], "expected either TARGETS (requirements or specs)"),
        (["bench", HARD, "--suite", "arch-comp"], "expected either TARGETS (requirements or specs)"),
        (["bench", HARD, "--instance", "2"], "--instance requires --suite"),
        (["bench", HARD, "--variant", "MP1"], "--variant and --effort require --llm"),
        (["bench", HARD, "--anonymous"], "--anonymous: applies to language models only"),
    ],
)
def test_wrong_usage_is_said(command: Any, arguments: list[str], message: str) -> None:
    result = command(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr


def test_watch_says_how_far_a_campaign_is(command: Any) -> None:
    bench(command, "--out", "c", "--quiet")
    for arguments in (["watch", "c"], ["watch", "c", "--once"]):
        result = command(*arguments)
        assert result.exit_code == 0
        assert "4/4 runs finished, 2 falsified" in result.stdout
        assert "stopped" not in result.stdout


def test_watch_ends_where_nobody_works_on(command: Any, tmp_path: Path) -> None:
    bench(command, "--out", "c", "--quiet")
    for journal in sorted((tmp_path / "c" / "runs").rglob("journal.jsonl"))[:2]:
        journal.write_text("".join(journal.read_text().splitlines(keepends=True)[:-2]))  # as after a kill
    for arguments in (["watch", "c"], ["watch", "c", "--once"]):
        result = command(*arguments)
        assert "2/4 runs finished" in result.stdout
        assert "running" not in result.stdout
        assert "stopped; to continue: falsifier resume c" in result.stdout
    with locked(tmp_path / "c"):
        result = command("watch", "c", "--once")
        assert "2 running" in result.stdout
        assert "stopped" not in result.stdout


def test_reports_of_a_campaign_and_of_one_run(command: Any, tmp_path: Path) -> None:
    bench(command, "--out", "c", "--quiet")
    written = command("report", "c", "--junit", "j.xml", "--arch-comp", "v.csv")
    assert written.exit_code == 0, written.output
    assert (tmp_path / "c" / "report.html").read_text().startswith("<!DOCTYPE html>")
    assert "<testsuites" in (tmp_path / "j.xml").read_text()
    assert (tmp_path / "v.csv").read_text().count("yes") == 2
    assert command("report", "c", "--markdown").stdout.startswith("# Falsification report: c")
    run = next((tmp_path / "c" / "runs").iterdir())
    command("report", str(run), "-o", "one.html")
    assert "1 requirement, 1 run," in (tmp_path / "one.html").read_text()


def test_validate_ends_with_1_where_a_claim_does_not_hold(command: Any, tmp_path: Path) -> None:
    (tmp_path / "v.csv").write_text(
        "system,property,instance,input,parameters,falsified,simulations\n"
        'AT,AT2,2,"[0 100 0]",[],1,2\n'
        'AT,AT2,2,"[0 0 0]",[],1,2\n'
    )
    result = command("validate", "v.csv")
    assert result.exit_code == 1
    assert "row 1, AT2: reproduced, robustness -" in result.stdout
    assert "row 2, AT2: not reproduced, robustness +" in result.stdout
    assert "1 of 2 counterexamples accepted" in result.stdout
    (found, other) = json.loads(command("validate", "v.csv", "--json").stdout)
    assert (found["holds"], other["holds"]) == (True, False)


def test_a_campaign_as_a_user_starts_it(tmp_path: Path) -> None:
    """In processes of its own, with real workers."""
    done = falsifier(
        *("bench", HARD, "--engine", "corners", "--runs", "2", "--budget", "5", "--jobs", "2", "--out", "c"),
        cwd=tmp_path,
    )
    assert done.code == 0, done.err
    assert "2/2" in done.out
    assert "HARD" in done.out
    again = falsifier("bench", HARD, "--engine", "corners", "--out", "c", cwd=tmp_path)
    assert again.code == 2
    assert "falsifier resume c" in again.err
