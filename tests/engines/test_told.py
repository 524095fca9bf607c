from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from falsifier.context.values import Context, Named
from falsifier.engines.told import doubts_told, reply_form, told_context, told_view
from falsifier.errors import SpecError
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import evaluate
from falsifier.llm.prompts import View, variant_named
from falsifier.llm.prompts.disguise import Disguise
from falsifier.problem.source import ProblemSource
from falsifier.testing import FREE, lag_problem

VIEW = View.of(lag_problem(free=FREE))


def test_lists_of_numbers_have_the_control_points_of_the_spec() -> None:
    assert told_view(VIEW, "json").space == VIEW.space
    assert all(r.free is None for r in told_view(VIEW, "points").space.inputs)


def test_the_form_of_replies_follows_the_variant() -> None:
    forms = {
        (variant, kind): reply_form(told_view(VIEW, kind), variant_named(variant), kind, count=2)
        for variant in ("MP1", "MP5")
        for kind in ("json", "points")
    }
    assert [key for key, form in forms.items() if form.named] == [("MP5", "json")]
    assert {key for key, form in forms.items() if form.points} == {("MP1", "points"), ("MP5", "points")}


def test_doubts_are_found_by_the_candidate_as_it_is_told() -> None:
    problem = lag_problem()
    high = problem.space.decode(np.ones(4), origin="test", rationale="")
    confirmation = replace(confirm(problem, evaluate(problem, high)), outcome="fragile", reason="the step")
    (real,) = doubts_told([confirmation], None)
    assert real == high.key
    disguise = Disguise.of(View.of(problem)).fitted([confirmation.evaluation])
    (hidden,) = doubts_told([confirmation], disguise)
    assert hidden == disguise.hidden_candidate(high).key


def test_context_is_read_only_if_it_is_told(tmp_path: Path) -> None:
    named = replace(lag_problem(), named_context=Named((str(tmp_path / "a.md"),)))
    (tmp_path / "a.md").write_text("y is limited to 3.")
    problem, variant = told_context(named, None)
    assert (problem.context.excerpts[0].text, variant.name) == ("y is limited to 3.", "MP6")
    assert told_context(named, "MP5")[0].context == Context()
    assert told_context(named, "MP5", anonymous=True)[1].name == "MP5"
    assert told_context(lag_problem(), None, anonymous=True)[1].name == "MP5"
    with pytest.raises(SpecError, match="--context none"):
        told_context(named, None, anonymous=True)
    asked = replace(named, source=ProblemSource(target="a", context=("a.md",)))
    with pytest.raises(SpecError, match="variant MP5 does not tell it; use MP6"):
        told_context(asked, "MP5")
