import pytest

from falsifier.llm.prompts.variants import VARIANTS
from falsifier.llm.tools import NAME, answer, predicted, what_if_tool
from falsifier.stl import Verdict

VERDICT = Verdict(-0.123456, 12.3456, "x <= 0.9")


@pytest.mark.parametrize(
    ("variant", "time", "predicate"),
    [("MP1", False, False), ("MP3", False, False), ("MP4", True, True), ("MP5", True, True)],
)
def test_predictions_tell_what_the_variant_tells_of_samples(
    variant: str, time: bool, predicate: bool
) -> None:
    text = predicted(VARIANTS[variant], VERDICT)
    assert "-0.123" in text
    assert ("12.35 s" in text, "x <= 0.9" in text) == (time, predicate)


def test_the_tool_says_how_often_it_answers() -> None:
    tool = what_if_tool({"type": "object"}, calls=3)
    assert (tool.name, tool.parameters) == (NAME, {"type": "object"})
    assert "3 calls" in tool.description


def test_an_answer_numbers_the_candidates_and_says_how_far_to_trust_it() -> None:
    first, second, error, _ = answer(["good", "bad"], error=0.1234, left=2).splitlines()
    assert first.endswith("1: good") and second.endswith("2: bad")
    assert "12 %" in error


def test_an_answer_says_how_many_more_calls_there_are() -> None:
    endings = [answer([], error=0.0, left=left).splitlines()[-1] for left in (2, 1, 0)]
    assert "2 more calls can be" in endings[0]
    assert "1 more call can be" in endings[1]
    assert "last" in endings[2]
