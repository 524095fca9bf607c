import pytest

from falsifier.errors import ChatError
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.conversation import converse
from tests.llm.server import Step, serving
from tests.llm.support import PLAIN, QUESTION, add
from tests.llm.test_client import REQUEST

REFUSALS = [
    Step(status=400, message="registry/gemma does not support tools"),
    Step(status=400, message='"auto" tool choice requires --enable-auto-tool-choice'),
    Step(status=404, message="No endpoints found that support tool use"),
    Step(status=500, message="tools param requires --jinja flag"),
    Step(status=422, message="function calling is not available"),
]


TOGETHER = Step(
    status=400, message="Function calling with a response mime type: 'application/json' is unsupported"
)


class TestLadder:
    @pytest.mark.parametrize("refusal", REFUSALS, ids=lambda step: step.message)
    def test_refused_tools_are_left_out_and_never_offered_again(self, refusal: Step) -> None:
        with serving(refusal, Step("3"), Step("4")) as server:
            chat = LiteLLMChat("openai/mine", api_base=server.url)
            assert chat.complete(QUESTION).text == "3"
            assert chat.complete(QUESTION).text == "4"
        assert ["tools" in r.body for r in server.received] == [True, False, False]
        assert all("response_format" in r.body for r in server.received)

    def test_where_both_are_refused_together_the_schema_goes_with_tools_only(self) -> None:
        with serving(TOGETHER, TOGETHER, Step("3"), Step("4"), Step("5")) as server:
            chat = LiteLLMChat("openai/mine", api_base=server.url)
            texts = [chat.complete(q).text for q in (QUESTION, QUESTION, PLAIN)]
        assert texts == ["3", "4", "5"]
        assert ["tools" in r.body for r in server.received] == [True, True, True, True, False]
        forms = [r.body.get("response_format", {}).get("type") for r in server.received]
        assert forms == ["json_schema", "json_object", None, None, "json_schema"]

    def test_below_the_last_rung_tools_go(self) -> None:
        with serving(TOGETHER, TOGETHER, TOGETHER, Step("3")) as server:
            assert LiteLLMChat("openai/mine", api_base=server.url).complete(QUESTION).text == "3"
        assert "tools" not in server.received[-1].body
        assert server.received[-1].body["response_format"]["type"] == "json_schema"

    def test_a_refusal_within_a_turn_is_an_error(self) -> None:
        with serving(Step(calls=(("add", {"terms": [1]}),)), REFUSALS[0]) as server:
            chat = LiteLLMChat("openai/mine", api_base=server.url)
            with pytest.raises(ChatError, match="in the same turn"):
                converse(chat, QUESTION, str.strip, lambda _: None, respond=add)


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
    Step(status=400, message="Failed to generate JSON. Please adjust your prompt."),
]


@pytest.mark.parametrize("unparsed", UNPARSED, ids=lambda step: step.message)
def test_what_a_server_cannot_parse_twice_is_asked_for_more_plainly(unparsed: Step) -> None:
    with serving(unparsed, Step("one"), unparsed, unparsed, Step("two")) as server:
        chat = LiteLLMChat("openai/m", api_base=server.url)
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
