"""What is found on what a run needs, against a scripted server."""

import json

import pytest

from falsifier.errors import ChatError
from falsifier.llm.check import Feature, check_chat
from falsifier.llm.connect import connect
from falsifier.llm.messages import Usage
from tests.llm.server import Step, serving

GOOD = Step(json.dumps({"values": [1, 2, 3], "rationale": "they sum to 6"}))
CUT = Step("one two", finish="length")
REFUSED = Step(status=400, message="response_format is not supported")


def checked(*steps: Step, effort: str | None = None) -> tuple[dict[str, Feature], Usage]:
    with serving(*steps) as server:
        features, usage = check_chat(connect("openai/mine", effort=effort, api_base=server.url, attempts=1))
    return {f.name: f for f in features}, usage


def test_a_model_that_does_it_all() -> None:
    found, usage = checked(GOOD, CUT, effort="low")
    assert list(found) == ["answer", "effort", "length"]
    assert all(f.works for f in found.values())
    assert "by a schema with numbers of values" in found["answer"].said
    assert "12 tokens of reasoning" in found["effort"].said
    assert usage.tokens == 240


def test_no_usable_answer() -> None:
    answer = checked(Step("I am ready."), CUT)[0]["answer"]
    assert not answer.works and "not the JSON that was asked for" in answer.said


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ((REFUSED, REFUSED, REFUSED, GOOD), "in words only"),
        ((REFUSED, GOOD), "by a schema"),
        ((Step("", extra={"reasoning_content": '{"values": [1, 2, 3]}'}),), "by a schema"),
    ],
)
def test_how_an_answer_came(steps: tuple[Step, ...], said: str) -> None:
    answer = checked(*steps, CUT)[0]["answer"]
    assert answer.works and said in answer.said


def test_a_limit_that_is_not_kept() -> None:
    found, _ = checked(GOOD, Step("one two three", finish="stop"))
    assert [f.works for f in found.values()] == [True, False]
    assert "not kept" in found["length"].said
    found, usage = checked(GOOD, Step(raw='{"choices": []}'))
    assert "without any choice" in found["length"].said
    assert usage.without_reply == 1 and usage.tokens > 120, "it has been sent and is paid for"


def test_a_wrong_key_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-wrong-key-wrong")
    with pytest.raises(ChatError, match="check OPENAI_API_KEY") as caught:
        checked(Step(status=401, message="wrong key sk-wrong-key-wrong"))
    assert "sk-wrong" not in str(caught.value)
