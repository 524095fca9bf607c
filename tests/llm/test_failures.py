import pytest

from falsifier.core.secrets import redact
from falsifier.errors import ChatError, ContextExceededError
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.failures import TransientChatError, classify
from tests.llm.server import Step, serving
from tests.llm.test_client import REQUEST


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


def test_ordinary_words_stay() -> None:
    text = "hf.co/openai/gpt-oss-20b at http://127.0.0.1:8000/v1 says: task key-value"
    assert redact(text) == text


def told(error: Exception | str, llm: str = "m", api_base: str | None = None) -> ChatError:
    """What becomes of an error of the client library."""
    error = RuntimeError(error) if isinstance(error, str) else error
    return classify(error, llm=llm, api_base=api_base, secrets=("my-secret-key",))


def test_no_secret_and_no_stack_survives_classification() -> None:
    said = "it was my-secret-key. Traceback (most recent call last): lots"
    error = str(told(said, "openai/x", "http://me:my-secret-key@host/v1?token=my-secret"))
    assert "my-secret" not in error and "Traceback" not in error and "openai/x at http://host/v1:" in error
    trace = "litellm.APIError: \nTraceback (most recent call last): content_policy_violation"
    assert "content filter" not in str(told(trace)), "a stack trace is not what the server says"


def test_the_servers_words_come_without_classes_and_full_stop() -> None:
    assert str(told("Connection error.")).endswith("Connection error")
    assert str(told("still loading ...")).endswith("still loading ...")
    assert str(told('{"error": {"message": "not\\n now."}}')).endswith("not now")
    assert "neutral names" in str(told("content_policy_violation"))


def test_a_context_that_is_too_short_is_told_in_the_servers_own_words() -> None:
    said = "request (9 tokens) exceeds the available context size (8 tokens), try increasing it"
    error = told(
        f"litellm.BadRequestError: ContextWindowExceededError: OpenAIException - {said}", "m", "http://x"
    )
    assert isinstance(error, ContextExceededError)
    assert "llama.cpp: --ctx-size" in str(error) and str(error).endswith(f"The server says: {said}")


@pytest.mark.parametrize(
    "said",
    [
        "This model's maximum context length is 8192 tokens",
        "The prompt (total length 5000) is longer than the maximum model length of 4096",
        "The prompt (total length 5000) is too long to fit into the model (total max length 4096)",
        "The number of tokens to keep from the initial prompt is greater than the context length",
        "Your input exceeds the context window of this model",
        "Please reduce the length of the messages or completion",
    ],
)
def test_a_context_that_is_too_short_is_known_by_the_words_of_each_server(said: str) -> None:
    with serving(Step(status=400, message=said)) as server, pytest.raises(ContextExceededError):
        LiteLLMChat("openai/m", api_base=server.url).send(REQUEST)


@pytest.mark.parametrize("model", ["openai/m", "ollama_chat/m", "hosted_vllm/m", "lm_studio/m"])
def test_where_nothing_listens_on_this_machine_little_patience_helps(
    model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with serving(Step()) as server:  # whose port nobody listens to when it has gone
        address = server.url
    naps: list[float] = []
    monkeypatch.setattr("falsifier.llm.client.sleep", naps.append)
    chat = LiteLLMChat(model, api_base=address)
    with pytest.raises(ChatError, match=f"nothing is listening at {address}: start the ") as caught:
        chat.complete(REQUEST)
    assert len(naps) == 2
    assert sum(naps) < 5
    if model == "ollama_chat/m":
        assert "'ollama serve'" in str(caught.value)


def test_where_there_is_no_account_none_is_to_be_checked() -> None:
    missing = Step(status=404, raw='{"error": "model \'m\' not found"}')
    with serving(missing) as server, pytest.raises(ChatError) as caught:
        LiteLLMChat("ollama_chat/m", api_base=server.root).send(REQUEST)
    assert str(caught.value).endswith("check the LLM's name and the server's address. model 'm' not found")


def test_servers_elsewhere_that_refuse_are_waited_for() -> None:
    error = told(ConnectionRefusedError(111, "Connection refused"), "openai/m", "http://elsewhere.example/v1")
    assert isinstance(error, TransientChatError) and error.patience is None


@pytest.mark.parametrize(
    ("step", "cure"),
    [
        (Step(status=413, message="Payload Too Large"), "use a plainer prompt variant"),
        (Step(status=429, message="Request too large for m: Limit 8"), "use a plainer prompt variant"),
        (
            Step(status=400, message="Unrecognized request argument supplied: top_k"),
            "refuses the option top_k; drop it",
        ),
        (
            Step(status=403, message="Your organization must be verified to use o3"),
            "allowed for the organisation",
        ),
        (Step(raw='{"error": {"message": "overloaded"}}'), "/v1: the server reports: overloaded"),
        (
            Step(raw='{"error": {"message": "no", "code": 401}}'),
            "check OPENAI_API_KEY. the server reports: no",
        ),
        (
            Step(raw='{"choices": [{"message": {}, "error": {"code": 502, "message": "overloaded"}}]}'),
            "/v1: the server reports: overloaded",
        ),
        (Step(status=503, message="context size pool overloaded"), "/v1: context size pool overloaded"),
        (Step(status=429, message="exceeded your current quota: PerDay. Retry in 7s."), "no quota left"),
        (Step(status=400, raw='{"error": "not loaded"}'), "/v1: not loaded"),
        (Step(status=400, raw='{"detail": [{"msg": "it\'s missing"}]}'), "/v1: it's missing"),
        (Step(raw='{"error": ["odd"]}'), '/v1: the server reports: ["odd"]'),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_each_failure_names_its_cure(step: Step, cure: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-some-key")
    with serving(step) as server, pytest.raises(ChatError) as caught:
        LiteLLMChat("openai/m", api_base=server.url, options={"top_k": 3}).send(REQUEST)
    assert cure in str(caught.value)
    if "overloaded" in cure:
        assert isinstance(caught.value, TransientChatError)
