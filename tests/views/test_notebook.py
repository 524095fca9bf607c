"""What values show in notebooks."""

import re
from base64 import b64decode
from typing import Any

import pytest
from IPython.core.formatters import DisplayFormatter

from falsifier import Evaluation, ParameterRange, assess, evaluate, explain, falsify, robustness_map, shrink
from falsifier.core.candidate import Candidate
from falsifier.testing import lag_problem
from falsifier.views.notebook import register
from falsifier.views.plotting import plot
from tests.pictures import CRITICAL, INPUT, OUTPUT, colours
from tests.problems import decades, hard, impossible


class Notebook:
    """An IPython shell, as far as it shows values."""

    def __init__(self) -> None:
        self.display_formatter = DisplayFormatter()

    def html(self, value: Any) -> str:
        shown, _ = self.display_formatter.format(value)  # type: ignore[no-untyped-call]
        return str(shown["text/html"])


@pytest.fixture
def notebook(monkeypatch: pytest.MonkeyPatch) -> Notebook:
    shell = Notebook()
    monkeypatch.setattr("IPython.core.getipython.get_ipython", lambda: shell)
    register()
    return shell


def pictures(html: str) -> list[bytes]:
    return [b64decode(data) for data in re.findall(r"base64,([^\"]+)", html)]


def test_a_problem_shows_its_formula_escaped_and_what_is_searched(notebook: Notebook) -> None:
    html = notebook.html(hard())
    assert "&lt;=" in html or "&gt;=" in html
    assert all(name in html for name in hard().space.names)
    whole = lag_problem(parameters=[ParameterRange("x0", 1234567000, 1234567999)])
    assert "1234567000 to 1234567999" in notebook.html(whole)
    assert "1e-07 to 1 in decades" in notebook.html(decades())


def test_figures_are_drawn_also_without_pyplot(notebook: Notebook) -> None:
    shown, _ = notebook.display_formatter.format(plot(falsify(hard())))  # type: ignore[no-untyped-call]
    assert OUTPUT in colours(shown["image/png"])


def test_a_violating_result_shows_its_robustness_and_a_picture(notebook: Notebook) -> None:
    result = falsify(hard(), "corners", budget=10)
    html = notebook.html(result)
    assert result.counterexample is not None
    problem, found = result.problem, result.counterexample.evaluation
    shown = (result.counterexample, found.candidate, problem.info, explain(problem, found))
    found_out = (assess(problem, budget=2), robustness_map(problem, found, budget=9), shrink(problem, found))
    words = ("<p>confirmed: a fresh sim", "u constant 1", "<pre>lag  FMI", "<p>HARD requires: ")
    words_out = ("<pre>Violations: ", "random changes", "u constant 1")
    assert all(
        each in notebook.html(value) for value, each in zip(shown + found_out, words + words_out, strict=True)
    )
    assert f"{found.robustness:+.6g} (violated" in html
    (picture,) = pictures(html)
    assert {OUTPUT, INPUT, CRITICAL} <= colours(picture), "what decided is drawn"


def test_a_result_without_a_violation_shows_the_best_and_why_it_ended(notebook: Notebook) -> None:
    html = notebook.html(falsify(impossible(), "corners", budget=3))
    assert "the budget of 3 simulations is used up" in html
    assert "(holds with this margin" in html


def test_a_trajectory_shows_each_signal(notebook: Notebook) -> None:
    problem = hard()
    trajectory = evaluate(problem, falsify(problem, budget=1).evaluations[0].candidate).trajectory
    assert trajectory is not None
    html = notebook.html(trajectory)
    assert all(f">{name}<" in html for name in trajectory.names)
    assert len(pictures(html)) == 1


def test_a_failed_evaluation_says_why(notebook: Notebook) -> None:
    html = notebook.html(Evaluation(Candidate({}, {"p": 1.0}), "failed", None, "division <by> zero"))
    assert "failed: division &lt;by&gt; zero" in html
