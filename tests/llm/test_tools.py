"""Tools: how they are offered, called, answered and refused."""

import json
from collections.abc import Sequence

import pytest

from falsifier.core.candidate import Candidate
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.messages import ToolCall
from falsifier.llm.prompts import VARIANTS
from falsifier.llm.replies import ReplyForm
from falsifier.llm.tools import MOST_CALLS, MOST_CANDIDATES, PredictionTool
from falsifier.stl import Verdict
from falsifier.testing import lag_problem


class Foreteller:
    """Predicts the last value of u as robustness."""

    recent_error = 0.125

    def __init__(self) -> None:
        self.seen: list[Candidate] = []

    def foresee(self, candidates: Sequence[Candidate]) -> list[Verdict]:
        self.seen += candidates
        return [Verdict(c.signals["u"].values[-1], 2.5, "x <= 0.9") for c in candidates]


def tool(variant: str = "MP5") -> tuple[PredictionTool, Foreteller]:
    foreteller = Foreteller()
    form = ReplyForm(lag_problem().space, count=MOST_CANDIDATES, reasoned=False)
    return (
        PredictionTool(foreteller, form, VARIANTS[variant], reveal=lambda c: c, hide=lambda v: v),
        foreteller,
    )


def about(*last: float) -> ToolCall:
    found = [{"signals": [{"name": "u", "values": [0, 0, 0, value]}]} for value in last]
    return ToolCall(id="1", name="predict", arguments=json.dumps({"candidates": found}))


class TestPredictionTool:
    def test_it_tells_robustness_time_predicate_and_error(self) -> None:
        made, foreteller = tool()
        told = made.respond(about(0.5, -0.25))
        assert "Candidate 1: predicted robustness +0.5, decided at about t = 2.5 s by x <= 0.9" in told
        assert "Candidate 2: predicted robustness -0.25" in told
        assert "12 %" in told and "2 more calls" in told
        assert [c.signals["u"].values[-1] for c in foreteller.seen] == [0.5, -0.25]

    def test_only_what_the_variant_tells_of_samples(self) -> None:
        assert "x <= 0.9" not in tool(variant="MP1")[0].respond(about(0.5))
        assert "2.5 s" not in tool(variant="MP3")[0].respond(about(0.5))

    def test_an_invalid_candidate_is_told_why_beside_the_valid_ones(self) -> None:
        told = tool()[0].respond(about(0.5, 7.0))
        assert "Candidate 1: predicted robustness +0.5" in told
        assert "Candidate 2: not predicted: " in told and "7 is outside its range [-1, 1]" in told

    @pytest.mark.parametrize(
        ("call", "problem"),
        [
            (about(7.0), "outside its range"),
            (about(), "no JSON object"),
            (ToolCall(id="1", name="simulate", arguments="{}"), "no tool 'simulate', only 'predict'"),
            (ToolCall(id="1", name="predict", arguments='{"candidates": [{"signals": [1'), "no JSON"),
        ],
    )
    def test_wrong_calls_say_what_is_wrong_and_do_not_count(self, call: ToolCall, problem: str) -> None:
        made, _ = tool()
        made.answered = MOST_CALLS - 1
        with pytest.raises(RejectedReplyError, match=problem):
            made.respond(call)
        assert "last call" in made.respond(about(0.5))
        with pytest.raises(RejectedReplyError, match="limit of 3 calls is reached"):
            made.respond(about(0.7))

    def test_too_many_candidates_are_cut(self) -> None:
        made, foreteller = tool()
        told = made.respond(about(*(0.01 * i for i in range(30))))
        assert len(foreteller.seen) == MOST_CANDIDATES
        assert "20 more: not predicted" in told
