import pytest

from falsifier.llm.failures import classify, redact


@pytest.mark.parametrize(
    "text",
    [
        "Authorization: Bearer abc.def-ghi",
        "https://user:hunter22@host/v1",
        "https://host/v1?key=abcdefgh&x=1",
        "incorrect key sk-proj-abcdefgh12345678",
        "api_key=abcdefgh",
    ],
)
def test_what_looks_like_a_secret_is_redacted(text: str) -> None:
    found = redact(text)
    assert "[redacted]" in found
    for secret in ("abc.def-ghi", "hunter22", "abcdefgh"):
        assert secret not in found


def test_secrets_of_the_environment_and_given_ones_are_redacted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOME_API_KEY", "plain-looking-value")
    monkeypatch.setenv("HF_TOKEN", "another-value")
    text = redact("plain-looking-value another-value third-value", ["third-value"])
    assert text == "[redacted] [redacted] [redacted]"


def test_ordinary_words_stay() -> None:
    text = "hf.co/openai/gpt-oss-20b at http://127.0.0.1:8000/v1 says: task key-value"
    assert redact(text) == text


def test_no_secret_survives_classification() -> None:
    error = classify(
        RuntimeError("it was my-secret-key. Traceback (most recent call last): lots"),
        model="openai/x",
        api_base="http://me:my-secret-key@host/v1",
        key_variables=("OPENAI_API_KEY",),
        secrets=("my-secret-key",),
    )
    assert "my-secret-key" not in str(error)
    assert "Traceback" not in str(error)
    assert "openai/x" in str(error)


def test_content_filter_and_long_prompts_say_what_to_do() -> None:
    def told(text: str) -> str:
        return str(classify(RuntimeError(text), model="m", api_base=None, key_variables=(), secrets=()))

    assert "--anonymous" in told("content_policy_violation")
    assert "too long" in told("this model's maximum context length is 8192 tokens")
