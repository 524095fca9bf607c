import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from falsifier.campaigns import Method
from falsifier.campaigns.analysis import Published, Run, Score, ablation_table, llms_table, load, main_table
from falsifier.campaigns.tables import statistics_json
from falsifier.problem.source import ProblemSource
from falsifier.search.budget import Budget
from falsifier.search.request import RunRequest

PUBLISHED = Published(
    {
        "best": {"HARD": Score(10, 10, 1.5, "FReaK"), "NEVER": Score(10, 10, 40.0, "FReaK")},
        "llm_falsifier": {"HARD": Score(10, 10, 1.0), "NEVER": Score(0, 10, None)},
        "uniform": {"HARD": Score(10, 10, 90.0), "NEVER": Score(0, 10, None)},
    },
    {"MP1": {"HARD": Score(9, 10, 25.2)}},
    {"gpt-5-mini-high": {"HARD": Score(10, 10, 1.0)}},
    sources={"best": "a report"},
)


@pytest.fixture
def runs(campaign: Path) -> list[Run]:
    return [replace(run, request=asked_for(run.requirement, 20)) for run in load(campaign)]


def asked_for(target: str, budget: int, **more: Any) -> RunRequest:
    return RunRequest(problems=(ProblemSource(target=target, **more),), budget=Budget(budget))


def cells(table_rows: tuple[tuple[str, ...], ...], header: tuple[str, ...], name: str) -> list[str]:
    return [row[header.index(name)] for row in table_rows]


def test_the_main_table_stands_beside_the_published_numbers(runs: list[Run]) -> None:
    table = main_table(runs, PUBLISHED)
    assert cells(table.rows, table.header, "requirement") == ["HARD", "HARD", "NEVER", "NEVER"]
    assert cells(table.rows, table.header, "method") == ["uniform", "corners"] * 2
    assert cells(table.rows, table.header, "FR") == ["2/2", "2/2", "0/2", "0/2"]
    # uniform needs 2 and 1 simulations, corners too
    assert cells(table.rows, table.header, "mean S") == ["1.5", "1.5", "–", "–"]
    assert cells(table.rows, table.header, "rank") == ["2 (tie)", "2 (tie)", "–", "–"]
    held = [replace(r, _robustness=[1e-300]) for r in runs[-1:]]
    assert cells(main_table(held, PUBLISHED).rows, table.header, "best robustness") == ["+0"]
    assert cells(table.rows, table.header, "best ARCH-COMP tool")[0] == "FReaK 10/10 / 1.5"
    assert cells(table.rows, table.header, "LLM-Falsifier")[2] == "0/10 / –"
    assert any("a report" in note for note in table.notes)


def test_free_parameterizations_and_other_profiles_stand_apart_and_without_published_numbers(
    runs: list[Run],
) -> None:
    free = [replace(run, method=replace(run.method, parameterization="free")) for run in runs]
    other = [replace(run, method=replace(run.method, profile="instance2")) for run in runs]
    shared = [replace(run, method=replace(run.method, together=True)) for run in runs]
    table = main_table([*runs, *free, *other, *shared], PUBLISHED)
    assert len(table.rows) == 16
    for row in table.rows:
        apart = any(told in row[1] for told in ("free", "instance2", "shared search"))
        assert (row[-1] == "") == apart
        assert row[table.header.index("rank")] in (("–",) if apart else ("2 (tie)", "–"))


def test_the_table_tells_what_cannot_be_compared(runs: list[Run]) -> None:
    known = runs[1].request.model_copy(update={"start_from": ({},), "seed": 7})
    # An own requirement may have the name of a published one. What is searched as fixed is in the method.
    own = asked_for("my.toml:HARD", 60, parameterization="fixed")
    changed = asked_for("HARD", 20, changes={"stop_time": 5.0})
    for request in (own, changed, known):
        assert "rank" not in main_table([replace(runs[0], request=request), runs[1]], PUBLISHED).header
    columns = ablation_table([replace(asked(runs[0], "MP1"), request=own)], PUBLISHED).rows[0]
    assert columns == ("HARD", "1/1 / 2.0", "–")
    table = main_table([runs[0], replace(runs[0], request=own), replace(runs[1], request=known)], PUBLISHED)
    assert cells(table.rows, table.header, "budget") == ["20, 60"]
    assert "Runs that began with known inputs: HARD uniform 1 of 3." in table.notes
    assert "Runs that repeat the seed of another, so intervals are too narrow: HARD uniform 1." in table.notes
    assert not any("counted together" in note for note in table.notes), (
        "neither a place nor a seed is a setting"
    )
    table = main_table([replace(runs[0], request=changed), *runs[1:2]], PUBLISHED)
    assert "Different ranges, options or context files, counted together: HARD uniform 2." in table.notes
    assert not any("seed" in n for n in main_table([asked(runs[0], "MP1")] * 2, PUBLISHED).notes), (
        "asked anew"
    )


def test_unfinished_runs_are_counted_apart_but_not_those_that_spent_their_budget(runs: list[Run]) -> None:
    first, *others = [run for run in runs if run.requirement == "NEVER" and run.method.engine == "uniform"]
    table = main_table([replace(first, status="interrupted"), *others], PUBLISHED)
    assert table.rows[0][2] == "0/1 +1"
    assert any(note.startswith("+n") for note in table.notes)
    alone = main_table([replace(first, status="interrupted")], PUBLISHED)
    assert dict(zip(alone.header, alone.rows[0], strict=True))["cost $"] == "–", "an unknown cost is not zero"
    mostly = replace(first, status="failed", spent=replace(first.spent, failed=15, kept=7))
    table = main_table([mostly, *others], PUBLISHED)
    assert table.rows[0][2] == "0/2"
    assert "Simulations that failed: NEVER uniform 15 of 40." in table.notes
    assert "Replies from the cache, whose tokens and cost are not counted: NEVER uniform 7." in table.notes
    died = replace(mostly, spent=replace(mostly.spent, simulations=19))
    assert main_table([died, *others], PUBLISHED).rows[0][2] == "0/1 +1"


def asked(run: Run, variant: str) -> Run:
    return replace(run, method=Method(llm="openai/gpt-5-nano", effort="low", variant=variant))


def test_the_ablation_table_has_a_column_a_variant(runs: list[Run]) -> None:
    hard = [run for run in runs if run.requirement == "HARD"]
    table = ablation_table([asked(run, variant=v) for v in ("MP1", "MP5") for run in hard[:2]], PUBLISHED)
    assert table.header == (
        "requirement",
        "MP1 (openai/gpt-5-nano low)",
        "MP5 (openai/gpt-5-nano low)",
        "MP1 published",
    )
    assert table.rows == (("HARD", "2/2 / 1.5", "2/2 / 1.5", "9/10 / 25.2"),)


def test_the_models_table_has_a_column_a_model(runs: list[Run]) -> None:
    hard = [run for run in runs if run.requirement == "HARD"]
    table = llms_table([*(asked(run, variant="MP4") for run in hard[:2]), *hard[2:]], PUBLISHED)
    assert table.header == ("requirement", "openai/gpt-5-nano low MP4", "gpt-5-mini-high published")
    assert table.rows == (("HARD", "2/2 / 1.5", "10/10 / 1.0"),)


def test_formats_carry_the_same_cells(runs: list[Run]) -> None:
    table = main_table(runs, PUBLISHED)
    assert table.csv().splitlines()[0] == ",".join(table.header)
    assert "| HARD | uniform | 2/2 |" in table.markdown()
    assert table.text().splitlines()[4].split()[:3] == ["HARD", "uniform", "2/2"]
    first = json.loads(statistics_json(runs))[0]
    assert (first["requirement"], first["label"], first["falsified_runs"]) == ("HARD", "uniform", 2)
