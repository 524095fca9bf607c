import re
from typing import Any

import pytest

from falsifier import falsify
from falsifier.views.progress import make_display, progress
from tests.problems import hard, impossible


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
