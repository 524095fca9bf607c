"""What a language model is told; a preview shows what is sent."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from falsifier.context.values import Context, Named
from falsifier.core.model import Variable
from falsifier.engines.briefing import preview, told_context
from falsifier.engines.llm import LLMEngine
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import evaluate
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.source import ProblemSource
from falsifier.testing import lag_problem
from tests.problems import stepped


@pytest.mark.parametrize("variant", ["MP1", "MP2", "MP5"])
def test_a_preview_is_what_is_sent(variant: str) -> None:
    problem = lag_problem()
    chat = ScriptedChat(['{"point": [0, 0, 0, 0]}', '{"point": [0, 0, 0, 1]}'])
    engine = LLMEngine(problem, chat, variant=variant)
    evaluation = evaluate(problem, *engine.ask())
    engine.tell([evaluation])
    engine.ask()
    assert chat.requests[0].messages == preview(problem, variant=variant)
    assert chat.requests[1].messages == preview(problem, variant=variant, evaluations=[evaluation])


def test_a_preview_tells_no_mode_that_cannot_be_read() -> None:
    problem: Any = stepped(lag_problem())
    mode = Variable("mode", kind="integer", variability="discrete")
    info = replace(problem.info, variables=(*problem.info.variables, mode))
    experiment = replace(problem.experiment, internals=("mode",))
    refused = replace(problem, model=replace(problem.model, info=info), experiment=experiment)
    assert preview(refused) == preview(problem)


def test_a_preview_tells_lessons_if_the_variant_asks_for_them_and_hides_real_names_if_asked_to() -> None:
    seen = [evaluate(lag_problem(), lag_problem().space.decode([0, 0, 0, 0]))]
    for variant, hides, lessons, is_told in (
        ("MP4", False, "x falls", False),
        ("MP5", False, "x falls", True),
        ("MP5", True, "x falls", False),
        ("MP5", True, "y1 falls", True),
    ):
        told = preview(lag_problem(), variant=variant, evaluations=seen, lessons=lessons, anonymous=hides)
        assert (lessons in told[1].content) is is_told


def test_context_is_read_only_if_it_is_told(tmp_path: Path) -> None:
    named = replace(lag_problem(), named_context=Named((str(tmp_path / "a.md"),)))
    (tmp_path / "a.md").write_text("y is limited to 3.")
    problem, variant = told_context(named, None)
    assert (problem.context.excerpts[0].text, variant.name) == ("y is limited to 3.", "MP6")
    assert told_context(named, "MP5")[0].context == Context()
    assert told_context(named, "MP5", anonymous=True)[1].name == "MP5"
    assert told_context(lag_problem(), None, anonymous=True)[1].name == "MP5"
    with pytest.raises(SpecError, match=r"context=\['none'\]"):
        told_context(named, None, anonymous=True)
    asked = replace(named, source=ProblemSource(target="a", context=("a.md",)))
    with pytest.raises(SpecError, match="variant MP5 does not tell it; use MP6"):
        told_context(asked, "MP5")
