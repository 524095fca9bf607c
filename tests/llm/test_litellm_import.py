import pytest

from falsifier.errors import ChatSetupError
from falsifier.llm.litellm_adapter import check_name, listed_price, may_take_tools


@pytest.mark.parametrize("llm", ["openai", "openai/", "openai//", "ollama_chat/ "])
def test_a_provider_alone_is_no_name(llm: str) -> None:
    with pytest.raises(ChatSetupError, match="names a provider, but no model: expected PROVIDER/MODEL"):
        check_name(llm)


def test_prices() -> None:
    listed = listed_price("openai/gpt-5-mini")
    assert listed is not None and 0 < listed.prompt < listed.completion
    assert listed_price("huggingface/openai/gpt-oss-20b") is None
    assert listed_price("openai/never-heard-of") is None


def test_the_table_is_believed_where_it_knows_the_model() -> None:
    assert may_take_tools("openai/gpt-5-mini")
    assert not may_take_tools("perplexity/sonar")
    assert may_take_tools("openai/never-heard-of")
    assert may_take_tools("perplexity/sonar", api_base="http://127.0.0.1:1/v1")
