"""What is found on what a run needs, against a scripted server."""

import json

import pytest

from falsifier.errors import ChatError
from falsifier.llm.check import Feature, LLMCheck, check_llm
from falsifier.llm.usage import Price
from tests.llm.server import Step, serving

GOOD = Step(json.dumps({"values": [1, 2, 3], "rationale": "they sum to 6"}))
CALL = Step(None, calls=(("measure", {"place": "Paris"}),), finish="tool_calls")
CUT = Step("one two", finish="length")
REFUSED = Step(status=400, message="response_format is not supported")


def checked(*steps: Step, **more: object) -> LLMCheck:
    with serving(*steps) as server:
        return check_llm("openai/mine", api_base=server.url, **more)  # type: ignore[arg-type]


def feature(found: LLMCheck, name: str) -> Feature:
    (one,) = (f for f in found.features if f.name == name)
    return one


def test_a_model_that_does_it_all() -> None:
    found = checked(GOOD, CALL, CUT, price=Price(prompt=1.0, completion=2.0), effort="low")
    assert found.is_usable and all(f.works for f in found.features)
    assert [f.name for f in found.features] == ["answer", "effort", "tools", "length"]
    assert "by a schema with numbers of values" in feature(found, "answer").said
    assert "12 tokens of reasoning" in feature(found, "effort").said
    assert found.usage.tokens == 360
    assert found.usage.cost == pytest.approx(3 * (100 * 1.0 + 20 * 2.0) / 1e6)
    assert (found.key, found.price) == ("", Price(prompt=1.0, completion=2.0))


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (Step(None), "empty (null)"),
        (Step("", finish="length"), "lower the effort"),
        (Step("I am ready."), "not the JSON that was asked for"),
        (Step(None, extra={"refusal": "no counterexamples"}), "refused: 'no counterexamples'"),
    ],
)
def test_no_usable_answer(step: Step, said: str) -> None:
    found = checked(step, CALL, CUT)
    assert not found.is_usable
    assert said in feature(found, "answer").said


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ((REFUSED, REFUSED, REFUSED, GOOD), "in words only"),
        ((REFUSED, GOOD), "by a schema"),
        ((Step(json.dumps({"values": [6], "rationale": ""})),), "1 values instead of 3"),
        ((Step("", extra={"reasoning_content": '{"values": [1, 2, 3]}'}),), "in the reasoning instead"),
    ],
)
def test_how_an_answer_came(steps: tuple[Step, ...], said: str) -> None:
    found = checked(*steps, CALL, CUT)
    assert found.is_usable
    assert said in feature(found, "answer").said


def test_tools_and_limits_that_are_not_taken() -> None:
    found = checked(GOOD, Step("It is warm."), Step("one two three", finish="stop"))
    assert found.is_usable
    assert not feature(found, "tools").works and "not called" in feature(found, "tools").said
    assert not feature(found, "length").works
    refused = checked(GOOD, Step(status=400, message="tools are not supported"), Step("It is warm."), CUT)
    assert "refused by the server" in feature(refused, "tools").said
    wrong = checked(GOOD, Step(None, calls=(("measure", {"town": "Paris"}),)), CUT)
    assert "wrong arguments" in feature(wrong, "tools").said


def test_a_wrong_key_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-wrong-key-wrong")
    with pytest.raises(ChatError, match="check OPENAI_API_KEY") as caught:
        checked(Step(status=401, message="wrong key sk-wrong-key-wrong"))
    assert "sk-wrong" not in str(caught.value)
