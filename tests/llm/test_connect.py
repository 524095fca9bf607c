"""From a name to a chat: what is checked before anything is sent."""

from pathlib import Path

import pytest

from falsifier.errors import ChatError, ChatSetupError
from falsifier.llm.cache import CachedChat
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.connect import check_llm, connect, preflight
from falsifier.llm.usage import Price
from tests.llm.server import Step, serving


@pytest.mark.parametrize(
    ("model", "variables"),
    [
        ("openai/gpt-5-mini", "OPENAI_API_KEY"),
        ("huggingface/openai/gpt-oss-20b", "HF_TOKEN or HUGGINGFACE_API_KEY"),
        ("anthropic/claude-sonnet-4-5", "ANTHROPIC_API_KEY"),
        ("gemini/gemini-2.5-flash", "GEMINI_API_KEY or GOOGLE_API_KEY"),
    ],
)
def test_a_missing_key_names_its_variable(model: str, variables: str) -> None:
    with pytest.raises(ChatError, match=f"{model}: no API key: set {variables}"):
        connect(model)


@pytest.mark.parametrize("variable", ["HF_TOKEN", "HUGGINGFACE_API_KEY"])
def test_either_variable_will_do(variable: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(variable, "hf_something")
    preflight("huggingface/openai/gpt-oss-20b")


@pytest.mark.parametrize("model", ["ollama_chat/gpt-oss:20b", "lm_studio/x", "hosted_vllm/x", "llamafile/x"])
def test_local_servers_need_no_key(model: str) -> None:
    preflight(model)


def test_an_empty_key_is_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "  ")
    with pytest.raises(ChatError, match="no API key"):
        preflight("openai/gpt-5-mini")


@pytest.mark.parametrize("model", ["opnai/gpt-5-mini", "some-model", "openai/"])
def test_a_name_of_no_provider_is_refused_with_the_form(model: str) -> None:
    with pytest.raises(ChatError, match="expected PROVIDER/MODEL such as openai/gpt-5-mini"):
        preflight(model)


def test_the_nearest_provider_is_suggested() -> None:
    with pytest.raises(ChatError, match="did you mean 'openai'"):
        preflight("opnai/gpt-5-mini")


def test_a_cache_is_opt_in(tmp_path: Path) -> None:
    assert isinstance(connect("ollama_chat/x"), LiteLLMChat)
    assert isinstance(connect("ollama_chat/x", cache=tmp_path), CachedChat)


def test_check_of_a_model() -> None:
    with serving(Step("ready")) as server:
        found = check_llm("openai/mine", api_base=server.url)
        assert found.reply == "ready"
        assert found.price is None
        assert found.key == ""
        assert found.usage.tokens == 120
        assert len(server.received) == 1
        assert "response_format" not in server.received[0].body
    with serving(Step("ready")) as server:
        price = Price(prompt=1.0, completion=2.0)
        found = check_llm("openai/mine", api_base=server.url, price=price)
        assert found.price == price
        assert found.usage.cost == pytest.approx((100 * 1.0 + 20 * 2.0) / 1e6)


def test_check_of_a_model_with_a_wrong_key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-wrong-key-wrong")
    with serving(Step(status=401, message="wrong key sk-wrong-key-wrong")) as server:
        with pytest.raises(ChatError, match="check OPENAI_API_KEY") as caught:
            check_llm("openai/mine", api_base=server.url)
        assert "sk-wrong" not in str(caught.value)
        assert len(server.received) == 1


@pytest.mark.parametrize("model", ["openai/gpt-5-mini", "anthropic/claude-sonnet-4-5"])
def test_an_option_that_the_provider_does_not_have_is_refused(
    model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for variable in ("OPENAI_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.setenv(variable, "sk-some-key")
    with pytest.raises(ChatSetupError, match=r"--llm-option max_token: .* did you mean 'max_tokens'"):
        connect(model, options={"max_token": 9})
    connect(model, options={"max_tokens": 9, "temperature": 1, "extra_headers": {"X": "y"}})


def test_options_of_servers_that_are_not_known_are_sent_as_they_are() -> None:
    connect("openai/m", api_base="http://127.0.0.1:9", options={"foo": 1})
    connect("ollama_chat/x", options={"foo": 1})


def test_the_time_for_a_reply_is_not_an_option_of_the_provider() -> None:
    with pytest.raises(ChatSetupError, match="use --llm-option timeout=SECONDS"):
        connect("ollama_chat/x", options={"timeout": 5})
