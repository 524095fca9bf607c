import pytest

from falsifier.errors import ChatSetupError
from falsifier.llm.providers import (
    NO_KEY,
    PROVIDERS,
    find_key,
    first_mode,
    key_variable,
    known,
    provider_of,
    server_address,
)


def test_grammars_that_break_gpt_oss_are_not_tried() -> None:
    assert first_mode("ollama_chat/gpt-oss:20b") == "prompt"
    assert first_mode("lm_studio/openai/gpt-oss-20b") == "prompt"
    assert first_mode("huggingface/openai/gpt-oss-20b") == "json_schema"


def test_limits_are_stated_to_servers_that_are_known_to_take_them() -> None:
    assert first_mode("ollama_chat/qwen3") == first_mode("openai/any") == "bounded_schema"
    assert first_mode("anthropic/claude-sonnet-4-5") == "json_schema"


@pytest.mark.parametrize(
    ("llm", "api_base", "environment", "key"),
    [
        ("openai/gpt-5-mini", None, {"OPENAI_API_KEY": " sk-1 "}, "sk-1"),
        ("gemini/x", None, {"GOOGLE_API_KEY": "g"}, "g"),
        ("gemini/x", None, {"GOOGLE_API_KEY": "g", "GEMINI_API_KEY": "first"}, "first"),
        ("openai/mine", "http://127.0.0.1/v1", {}, NO_KEY),
        ("openai/mine", "http://127.0.0.1/v1", {"OPENAI_API_KEY": "sk-1"}, "sk-1"),
        ("lm_studio/x", None, {}, NO_KEY),
        ("ollama_chat/x", None, {}, None),
        ("hosted_vllm/x", None, {}, None),
        ("nobody/x", None, {}, None),
        ("anthropic/x", "http://127.0.0.1", {}, None),
    ],
)
def test_the_key_comes_from_the_providers_variables(
    llm: str,
    api_base: str | None,
    environment: dict[str, str],
    key: str | None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in (n for p in PROVIDERS.values() for n in p.keys):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert find_key(llm, api_base=api_base) == key
    assert key_variable(llm) in ("", *known(llm).keys)


def test_a_missing_key_names_all_variables_that_may_hold_it(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("HF_TOKEN", "HUGGINGFACE_API_KEY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ChatSetupError, match="HF_TOKEN or HUGGINGFACE_API_KEY"):
        find_key("huggingface/openai/gpt-oss-20b")


def test_a_server_is_where_it_is_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OLLAMA_API_BASE", raising=False)
    assert server_address("ollama_chat/x", None) == known("ollama/x").address
    monkeypatch.setenv("OLLAMA_API_BASE", "http://127.0.0.1:1")
    assert server_address("ollama_chat/x", None) == "http://127.0.0.1:1"
    assert server_address("ollama_chat/x", "http://127.0.0.1:2") == "http://127.0.0.1:2"
    assert server_address("openai/x", None) == ""


def test_the_provider_is_the_first_part_of_the_name() -> None:
    assert provider_of("huggingface/openai/gpt-oss-20b") == "huggingface"
    assert known("nobody/x").keys == ()
