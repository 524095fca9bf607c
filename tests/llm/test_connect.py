"""From a name to a chat: what is checked before anything is sent."""

from pathlib import Path

import pytest

from falsifier.errors import ChatError, ChatSetupError
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.connect import CachedChat, connect, preflight


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
