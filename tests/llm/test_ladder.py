import pytest

from falsifier.errors import ChatError
from falsifier.llm.client import LiteLLMChat
from tests.llm.server import Step, serving
from tests.llm.test_client import REQUEST


def test_ladder_finds_the_form_that_a_server_takes_and_remembers_it() -> None:
    refused = Step(status=400, message="response_format is not supported")
    with serving(refused, refused, Step("in words"), Step("again")) as server:
        chat = LiteLLMChat("openai/m", api_base=server.url)
        first, second = chat.complete(REQUEST), chat.complete(REQUEST)
    kinds = [r.body.get("response_format", {}).get("type") for r in server.received]
    assert kinds == ["json_schema", "json_object", None, None]
    assert first.parameters["mode"] == "prompt"
    assert second.text == "again"


UNPARSED = [
    Step(status=500, message="The model produced output that does not match the expected peg-native format"),
    Step(status=500, message="Failed to parse input at pos 12: <tool_call>{"),
    Step(status=400, message='Failed to generate JSON. See {"failed_generation": {"top_k": 1}}'),
]


@pytest.mark.parametrize("unparsed", UNPARSED, ids=lambda step: step.message)
def test_what_a_server_cannot_parse_twice_is_asked_for_more_plainly(unparsed: Step) -> None:
    with serving(unparsed, Step("one"), unparsed, unparsed, Step("two")) as server:
        chat = LiteLLMChat("openai/m", api_base=server.url, options={"top_k": 3})  # which it may write of
        texts = [chat.complete(REQUEST).text for _ in range(5)]
    assert texts == ["", "one", "", "", "two"]
    kinds = [r.body["response_format"]["type"] for r in server.received]
    assert kinds == ["json_schema"] * 4 + ["json_object"]


def test_ladder_ends_at_its_last_rung() -> None:
    refused = Step(status=400, message="grammar is not supported")
    samplers = Step(status=400, message="Failed to initialize samplers: std::exception")
    with serving(samplers, refused, refused) as server, pytest.raises(ChatError, match="grammar"):
        LiteLLMChat("openai/m", api_base=server.url).complete(REQUEST)
    assert len(server.received) == 3
