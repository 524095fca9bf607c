"""What values show in notebooks."""

import re
from base64 import b64decode
from typing import Any

import pytest

from falsifier import Evaluation, evaluate, falsify
from falsifier.core.space import Candidate
from falsifier.views.notebook import progress
from falsifier.views.text import make_display
from tests.problems import hard, impossible

PNG = b"\x89PNG"


def pictures(html: str) -> list[bytes]:
    return [b64decode(data) for data in re.findall(r"base64,([^\"]+)", html)]


def test_a_problem_shows_its_formula_escaped_and_what_is_searched() -> None:
    html = hard()._repr_html_()
    assert "&lt;=" in html or "&gt;=" in html
    assert all(name in html for name in hard().space.names)


def test_a_violating_result_shows_its_robustness_and_a_picture() -> None:
    result = falsify(hard(), "corners", budget=10)
    html = result._repr_html_()
    assert result.counterexample is not None
    assert f"{result.counterexample.evaluation.robustness:+.6g} (violated)" in html
    assert [content[:4] for content in pictures(html)] == [PNG]


def test_a_result_without_a_violation_shows_the_best_and_why_it_ended() -> None:
    html = falsify(impossible(), "corners", budget=3)._repr_html_()
    assert "the budget of 3 simulations is used up" in html
    assert "(holds)" in html


def test_a_trajectory_shows_each_signal() -> None:
    problem = hard()
    trajectory = evaluate(problem, falsify(problem, budget=1).evaluations[0].candidate).trajectory
    assert trajectory is not None
    html = trajectory._repr_html_()
    assert all(f">{name}<" in html for name in trajectory.names)
    assert len(pictures(html)) == 1


def test_a_failed_evaluation_says_why() -> None:
    html = Evaluation(Candidate({}, {"p": 1.0}), "failed", None, "division <by> zero")._repr_html_()
    assert "failed: division &lt;by&gt; zero" in html


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


def test_in_a_notebook_the_command_lines_display_is_that_line(
    front_end: Shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    with make_display() as display:
        falsify(hard(), "corners", budget=5, listeners=[display])
    assert "falsified; violation confirmed" in front_end.lines[-1]
