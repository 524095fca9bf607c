import re
from typing import Any

import pytest

from falsifier import falsify
from falsifier.testing import lag_problem
from falsifier.views.progress import make_display, progress
from falsifier.views.text import result_json, result_text
from tests.problems import broken, hard, impossible, mostly_broken


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
    assert [re.findall(r"> (\d) of 3 simulations", line) for line in front_end.lines] == [
        ["0"],
        ["1"],
        ["2"],
        ["3"],
        ["3"],
    ]
    assert "not falsified" in front_end.lines[-1]


def test_in_a_notebook_the_command_lines_display_is_that_line(front_end: Shown) -> None:
    with make_display() as display:
        falsify(hard(), "corners", budget=5, listeners=[display])
    assert "falsified; violation confirmed" in front_end.lines[-1]


def test_a_warning_comes_once_when_most_simulations_have_failed(capsys: pytest.CaptureFixture[str]) -> None:
    problem = lag_problem("G[0,10] (x <= 2)", response=mostly_broken)
    with make_display() as display:
        result = falsify(problem, "uniform", budget=20, seed=1, listeners=[display])
    warnings = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning: ")]
    assert len(warnings) == 1
    assert re.match(r"warning: \d+ of \d+ simulations have failed; the run counts as failed", warnings[0])
    assert f"failed after 20 simulations, {result.spent.failures} of them failed" in result_text(result)
    assert result_json(result)["spent"]["failures"] == result.spent.failures


def test_a_few_failures_bring_no_warning(capsys: pytest.CaptureFixture[str]) -> None:
    with make_display() as display:
        falsify(
            lag_problem("G[0,10] (x <= 2)", response=broken), "uniform", budget=2, seed=1, listeners=[display]
        )
    assert "warning" not in capsys.readouterr().err
