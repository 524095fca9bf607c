import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from falsifier import falsify
from falsifier.context.values import Named
from falsifier.evaluation.evaluate import evaluate
from falsifier.search.budget import Budget, Spent
from falsifier.search.events import Evaluated, RunStarted
from falsifier.testing import lag_problem
from falsifier.views.progress import make_display, progress
from falsifier.views.text import result_json, result_text
from tests.problems import hard, impossible, mostly_broken


class Shown:
    """Stands for the front end."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def __call__(self, line: Any, *, display_id: bool) -> "Shown":
        assert display_id
        self.update(line)
        return self

    def update(self, line: Any) -> None:
        self.lines.append(line.data)


@pytest.fixture
def front_end(monkeypatch: pytest.MonkeyPatch) -> Shown:
    shown = Shown()
    monkeypatch.setattr("IPython.display.display", shown)
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    return shown


def test_progress_is_one_line_that_ends_with_the_outcome(front_end: Shown) -> None:
    falsify(impossible(), "uniform", budget=3, listeners=[progress()])
    counts = [re.findall(r"> (\d) of 3 simulations", line) for line in front_end.lines]
    assert counts == [["0"], ["1"], ["2"], ["3"], ["3"]]
    assert "not falsified" in front_end.lines[-1]


def test_no_time_is_left_when_a_run_has_ended(front_end: Shown) -> None:
    falsify(hard(), "corners", budget=Budget(10_000_000, seconds=90), listeners=[progress()])
    assert any(re.search(r"about (8\d|90) s left", line) for line in front_end.lines)
    assert " left" not in front_end.lines[-1]


def test_in_a_notebook_the_command_lines_display_is_that_line(front_end: Shown) -> None:
    with make_display() as display:
        falsify(hard(), "corners", budget=5, listeners=[display])
    assert "falsified; HARD: violation confirmed" in front_end.lines[-1]


@pytest.mark.parametrize(("engine", "is_read"), [("surrogate", True), ("corners", False)])
def test_the_first_lines_say_which_context_of_a_spec_is_read(
    engine: str, is_read: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    notes = tmp_path / "notes.md"
    notes.write_text("x must stay below 0.9\n")
    problem = replace(hard(), named_context=Named((str(notes),)))
    with make_display() as display:
        falsify(problem, engine, budget=1, listeners=[display])
    assert (f", context: {notes}" in capsys.readouterr().err.splitlines()[1]) == is_read


def test_a_cause_is_told_once_and_that_most_have_failed(capsys: pytest.CaptureFixture[str]) -> None:
    problem = lag_problem("G[0,10] (x <= 2)", response=mostly_broken)
    with make_display() as display:
        result = falsify(problem, "uniform", budget=20, seed=1, listeners=[display])
    lines = capsys.readouterr().err.splitlines()
    told = [line for line in lines if " failed: " in line]
    assert told == ["simulation 1 failed: lag: output 'x' is nan at t = 0.5 s"], "each cause once"
    warnings = [line for line in lines if line.startswith("warning: ")]
    assert len(warnings) == 1
    assert re.match(r"warning: \d+ of \d+ simulations have failed; the run counts as failed", warnings[0])
    assert f"failed after 20 simulations, {result.spent.failed} of them failed" in result_text(result)
    assert result_json(result)["spent"]["failed"] == result.spent.failed


def test_of_several_requirements_progress_names_the_one_that_improved(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with make_display() as display:
        falsify([impossible(), hard()], "uniform", budget=6, listeners=[display])
    improved = [line for line in capsys.readouterr().err.splitlines() if "best robustness" in line]
    assert improved[0].startswith("simulation 1: NEVER: best robustness +")
    assert "; HARD: best robustness " in improved[0]
    assert len(improved) == len(set(improved))


def test_if_nothing_gets_better_it_is_told_how_far_the_search_is(capsys: pytest.CaptureFixture[str]) -> None:
    problem = lag_problem("G[0,10] (x <= 2)")
    evaluation = evaluate(problem, problem.space.decode([0.0] * 4))
    display = progress()
    display(
        RunStarted(
            problems=(problem,),
            engines=("uniform",),
            budget=Budget(1000, seconds=50.0),
            searched=problem.space,
        )
    )
    for count in range(1, 301):  # 0.1 s each
        display(
            Evaluated(
                index=count - 1,
                problem=problem,
                evaluation=evaluation,
                judged={"LAG": evaluation},
                improved=count == 1,
                best=evaluation,
                spent=Spent(simulations=count, seconds=count / 10),
            )
        )
    told = [line for line in capsys.readouterr().err.splitlines() if "simulation" in line]
    assert told[0] == "simulation 1: best robustness +2 at t = 0 s"
    assert told[1:] == [
        "101 of 1000 simulations, about 40 s left.",
        "201 of 1000 simulations, about 30 s left.",
    ]


def test_the_time_that_a_long_simulation_has_reached_is_a_plain_number(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    module, shown = "falsifier.views.progress", list[str]()
    console = Console(force_terminal=True, file=StringIO())
    monkeypatch.setattr(f"{module}.error_console", lambda: console)
    monkeypatch.setattr(f"{module}.live_line", lambda _: nullcontext(shown.append))

    @contextmanager
    def watching(tell: Callable[[str, float, float], None]) -> Iterator[None]:
        tell("plant", 43211.3, 86400.0)
        yield

    monkeypatch.setattr(f"{module}.watching", watching)
    with make_display():
        pass
    assert shown == [": simulated 43211.3 of 86400 s"]
