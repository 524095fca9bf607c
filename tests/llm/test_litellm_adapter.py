"""What the client library is given, and what it may do when it is imported."""

from falsifier.llm.litellm_adapter import listed_price


def test_prices() -> None:
    listed = listed_price("openai/gpt-5-mini")
    assert listed is not None and 0 < listed.prompt < listed.completion
    assert listed_price("huggingface/openai/gpt-oss-20b") is None
    assert listed_price("openai/never-heard-of") is None
