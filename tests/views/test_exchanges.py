"""What a run asked a language model, as the report and a notebook show it."""

import json
from pathlib import Path

import pytest

from falsifier.llm.messages import ChatReply, Usage
from falsifier.llm.scripted import ScriptedChat
from falsifier.record.run import falsify
from falsifier.views.exchanges import exchanges_html
from falsifier.views.notebook import result_html
from falsifier.views.report import html_report
from tests.problems import impossible

EVIL = "<script>alert(1)</script>"
NAME = impossible().name


def chat() -> ScriptedChat:
    """Answers with constant inputs; the second reply is useless, and the rationales are attacks."""
    signals = ([{"name": "u", "values": [0.01 * n]}] for n in range(1, 8))
    texts = [json.dumps({"rationale": f"{EVIL} answer {n}", "signals": s}) for n, s in enumerate(signals, 1)]
    texts[1] = "no idea"
    usage = Usage(prompt_tokens=700, completion_tokens=50, cost=0.0)
    return ScriptedChat(ChatReply(text=text, seconds=750.0, usage=usage) for text in texts)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six samples of a model, the second after a rejected reply."""
    directory = tmp_path_factory.mktemp("asked") / "run"
    falsify(impossible(), llm=chat(), budget=6, directory=directory)
    return directory


def test_each_question_is_told_with_its_rationale_and_what_came_of_it(run: Path) -> None:
    html = exchanges_html(run, NAME, most=10)
    assert html.count('class="exchange"') == 6 and html.count('class="prompt"') == 7
    assert "2 questions before sample 2, 1500 tokens, 1500 s: robustness +" in html
    assert "no idea" in html and "<b>Rejected: </b>" in html
    assert "&lt;script&gt;alert(1)&lt;/script&gt; answer 1" in html and EVIL not in html
    assert "as in the question before" in html
    assert html.count("You search for a counterexample") == 1, "each text once"


def test_long_runs_are_cut_and_say_how_the_rest_is_seen(run: Path) -> None:
    html = exchanges_html(run, NAME, most=2)
    assert html.count('class="exchange"') == 2
    assert "Earlier questions are not shown" in html
    assert f"falsifier llm prompt {run} --at N" in html
    assert "before sample 6" in html and "before sample 2," not in html


def test_the_report_and_a_notebook_show_them(run: Path) -> None:
    page = html_report(run)
    assert "What was asked, and what came of it" in page
    assert page.count('class="exchange"') == 6
    assert "questions included" in page
    result = falsify(impossible(), llm=chat(), budget=2, directory=run.parent / "second")
    assert result_html(result).count('class="exchange"') == 2


def test_a_run_that_asked_nothing_shows_nothing(tmp_path: Path) -> None:
    falsify(impossible(), "uniform", budget=2, directory=tmp_path / "run")
    assert exchanges_html(tmp_path / "run", NAME, most=5) == ""
    assert "What was asked" not in html_report(tmp_path / "run")
