from dataclasses import replace

import numpy as np

from falsifier.engines.told import doubts_told, reply_form, told_view
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import evaluate
from falsifier.llm.disguise import Disguise
from falsifier.llm.prompts import View, variant_named
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
