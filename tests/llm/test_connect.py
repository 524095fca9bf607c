"""From a name to a chat: what is checked before anything is sent, and replies that are kept."""

from pathlib import Path

import pytest

from falsifier.errors import ChatError, ChatSetupError
from falsifier.llm import litellm_adapter
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.connect import connect, preflight
from falsifier.llm.conversation import converse
from falsifier.llm.messages import ChatReply, Message, Usage
from falsifier.llm.providers import NO_KEY, find_key, first_mode, known, server_address
from falsifier.llm.scripted import ScriptedChat
from falsifier.llm.usage import Price
from falsifier.search.make_engines import open_chat, price_of
from falsifier.search.request import LLMSettings
from tests.llm.server import Step, serving
from tests.llm.support import PLAIN, Served


@pytest.mark.parametrize(
    ("llm", "api_base", "environment", "key"),
    [
        ("openai/gpt-5-mini", None, {"OPENAI_API_KEY": " sk-1 "}, "sk-1"),
        ("gemini/x", None, {"GOOGLE_API_KEY": "g"}, "g"),
        ("gemini/x", None, {"GOOGLE_API_KEY": "g", "GEMINI_API_KEY": "first"}, "first"),
        ("huggingface/openai/gpt-oss-20b", None, {"HF_TOKEN": "hf"}, "hf"),
        ("openai/mine", "http://127.0.0.1/v1", {}, NO_KEY),
        ("openai/mine", "http://127.0.0.1/v1", {"OPENAI_API_KEY": "sk-1"}, "sk-1"),
        ("lm_studio/x", None, {}, NO_KEY),
        ("llamafile/x", None, {}, NO_KEY),
        ("ollama_chat/x", None, {}, None),
        ("hosted_vllm/x", "http://127.0.0.1/v1", {}, None),
        ("openai/mine", None, {"OPENAI_API_BASE": "http://127.0.0.1/v1"}, NO_KEY),
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
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert find_key(llm, api_base=api_base) == key
    preflight(llm, api_base=api_base)


@pytest.mark.parametrize(
    ("llm", "variables"),
    [
        ("openai/gpt-5-mini", "OPENAI_API_KEY"),
        ("huggingface/openai/gpt-oss-20b", "HF_TOKEN or HUGGINGFACE_API_KEY"),
        ("gemini/gemini-2.5-flash", "GEMINI_API_KEY or GOOGLE_API_KEY"),
    ],
)
def test_a_missing_key_names_its_variables(llm: str, variables: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "  ")
    with pytest.raises(ChatError, match=f"{llm}: no API key: set {variables}"):
        connect(llm)


@pytest.mark.parametrize("llm", ["opnai/gpt-5-mini", "some-model", "openai/", "openai", "ollama_chat/ "])
def test_a_name_of_no_provider_or_no_model_is_refused_with_the_form(llm: str) -> None:
    with pytest.raises(ChatSetupError, match="expected PROVIDER/MODEL such as openai/gpt-5-mini") as caught:
        preflight(llm)
    assert ("did you mean 'openai'" in str(caught.value)) == (llm == "opnai/gpt-5-mini")


def test_an_effort_in_a_name_would_be_lost() -> None:
    with pytest.raises(ChatSetupError, match=r"beside the name: 'ollama_chat/x', effort='high'"):
        connect("ollama_chat/x@high")


@pytest.mark.parametrize("llm", ["openai/gpt-5-mini", "anthropic/claude-sonnet-4-5"])
def test_an_option_that_the_provider_does_not_have_is_refused(
    llm: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for variable in ("OPENAI_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.setenv(variable, "sk-some-key")
    with pytest.raises(ChatSetupError, match=r"^max_token: .* did you mean 'max_tokens'"):
        connect(llm, options={"max_token": 9})
    connect(llm, options={"max_tokens": 9, "temperature": 1, "extra_headers": {"X": "y"}})


def test_options_of_servers_that_are_not_known_are_sent_as_they_are() -> None:
    connect("openai/m", api_base="http://127.0.0.1:9", options={"foo": 1})
    connect("ollama_chat/x", options={"foo": 1})
    with pytest.raises(ChatSetupError, match="timeout: pass it as an argument"):
        connect("ollama_chat/x", options={"timeout": 5})
    for name in ("model", "messages", "drop_params"):
        with pytest.raises(ChatSetupError, match=f"^{name}: every request states it by itself; leave it out"):
            connect("ollama_chat/x", options={name: "x"})


def test_a_server_is_where_it_is_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    assert server_address("ollama_chat/x", None) == known("ollama/x").address
    monkeypatch.setenv("OLLAMA_API_BASE", "http://127.0.0.1:1")
    assert server_address("ollama_chat/x", None) == "http://127.0.0.1:1"
    assert server_address("ollama_chat/x", "http://127.0.0.1:2") == "http://127.0.0.1:2"
    assert server_address("openai/x", None) is None
    monkeypatch.setenv("OPENAI_API_BASE", "http://127.0.0.1:3")
    monkeypatch.setenv("OPENAI_BASE_URL", "http://127.0.0.1:4")  # which litellm looks at first
    assert server_address("openai/x", None) == "http://127.0.0.1:4"
    monkeypatch.setenv("OPENAI_BASE_URL", "127.0.0.1:4")
    with pytest.raises(
        ChatSetupError, match=r"^OPENAI_BASE_URL in the environment: expected http://HOST:PORT"
    ):
        connect("openai/x")


@pytest.mark.parametrize(
    ("llm", "address"),
    [
        ("lm_studio/x", "http://localhost:1234/v1"),
        ("llamafile/x", "http://127.0.0.1:8080/v1"),
        ("ollama_chat/x", "http://localhost:11434"),
        ("hosted_vllm/x", "http://127.0.0.1:9/v1"),
    ],
)
def test_prompts_are_sent_to_the_server_that_is_meant(
    llm: str, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def sent(llm: str, **arguments: object) -> None:
        raise ConnectionError(f"to {arguments['api_base']}")

    monkeypatch.setenv("HOSTED_VLLM_API_BASE", "http://127.0.0.1:9/v1")
    monkeypatch.setattr(litellm_adapter, "completed", sent)
    with pytest.raises(ChatError, match=f"^{llm} at {address}: .*to {address}$"):
        connect(llm, attempts=1).send(PLAIN)  # type: ignore[attr-defined]


@pytest.mark.parametrize("provider", ["hosted_vllm", "custom_openai", "litellm_proxy", "xinference"])
def test_a_server_of_the_users_own_must_be_named(provider: str) -> None:
    with pytest.raises(ChatSetupError, match=rf"where is the server.* or set {provider.upper()}_API_BASE"):
        connect(f"{provider}/x")


def test_a_short_text_in_place_of_the_key_of_openai_hinders_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "key")
    with serving(Step("an answer")) as server:  # litellm sends it "fake-api-key"
        assert connect("hosted_vllm/x", api_base=server.url, attempts=1).complete(PLAIN).text == "an answer"


@pytest.mark.parametrize(
    ("key", "whose"), [("sk-openai", "the key of OpenAI"), ("  ", "a key of blanks only")]
)
@pytest.mark.parametrize("llm", ["nvidia_nim/x", "perplexity/x", "deepinfra/x"])
def test_the_key_of_openai_goes_to_no_other_provider(
    llm: str, key: str, whose: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """litellm takes it where it knows no other one."""
    monkeypatch.setenv("OPENAI_API_KEY", key)
    with serving(Step("an answer")) as server:
        refused = rf"sent to 127\.0\.0\.1: it would have got {whose}; set .*_API_KEY"
        with pytest.raises(ChatError, match=refused) as caught:
            connect(llm, api_base=server.url, attempts=1).complete(PLAIN)
        assert not server.received and "sk-openai" not in str(caught.value)


@pytest.mark.parametrize("llm", ["custom_openai/x", "litellm_proxy/x", "xinference/x"])
def test_a_server_of_ones_own_needs_no_key(llm: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-openai")
    for variable in ("OPENAI_ORGANIZATION", "OPENAI_ORG_ID", "OPENAI_PROJECT_ID"):
        monkeypatch.setenv(variable, "account")
    monkeypatch.setenv("OPENAI_CUSTOM_HEADERS", "X-Account: account")
    with serving(Step("an answer"), Step("an answer")) as server:
        assert connect(llm, api_base=server.url, attempts=1).complete(PLAIN).text == "an answer"
        connect("openai/x", api_base=server.url).complete(PLAIN)
    assert [r.headers["authorization"] for r in server.received] == [f"Bearer {NO_KEY}", "Bearer sk-openai"]
    assert [list(r.headers.values()).count("account") for r in server.received] == [0, 3]


def test_a_missing_key_that_only_litellm_misses_is_told_at_once() -> None:
    with pytest.raises(ChatError, match=r"^nvidia_nim/x: no API key: set NVIDIA_NIM_API_KEY in the env"):
        connect("nvidia_nim/x").complete(PLAIN)
    with pytest.raises(ChatError, match=r"^fireworks_ai/x: FIREWORKS_API_KEY is not set"):
        connect("fireworks_ai/x").complete(PLAIN)


@pytest.mark.parametrize("address", ["http://127.0.0.1:80/v 1", " http://127.0.0.1:80/v1", "http://a\tb/v1"])
def test_an_address_has_no_blanks(address: str) -> None:
    with pytest.raises(ChatSetupError, match=r"expected http://HOST:PORT/v1"):
        connect("openai/x", api_base=address)


@pytest.mark.parametrize(
    ("options", "wrong"),
    [
        ({"top_p": float("nan")}, "top_p: expected a finite number, got nan"),
        ({"max_tokens": "many"}, "max_tokens: expected an integer from 1 on, got 'many'"),
        ({"max_tokens": 0}, "max_tokens: expected an integer from 1 on, got 0"),
        ({"max_tokens": True}, "max_tokens: expected an integer from 1 on, got True"),
        ({"max_completion_tokens": 2.5}, "max_completion_tokens: expected an integer from 1 on, got 2.5"),
        ({"base_url": "http://127.0.0.1:1"}, "base_url: state the address of a server as api_base"),
        ({"custom_llm_provider": "groq"}, "custom_llm_provider: .* the provider as the first part"),
    ],
)
def test_an_option_with_a_value_that_cannot_be_sent_or_kept_is_refused(
    options: dict[str, str | float], wrong: str
) -> None:
    with pytest.raises(ChatSetupError, match=f"^{wrong}"):
        connect("ollama_chat/x", options=options)
    with pytest.raises(ChatSetupError, match=f"^{wrong}"):
        LLMSettings(name="ollama_chat/x", options=options)


@pytest.mark.parametrize("provider", ["openai", "hosted_vllm"])  # with a variable that is listed, and without
@pytest.mark.parametrize(("key", "place"), [("\u201csk-1\u201d", 1), ("sk-\u00e4", 4), ("sk-1\nsk-2", 5)])
def test_a_key_that_no_request_can_contain_is_refused_and_not_shown(
    provider: str, key: str, place: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    variable = f"{provider.upper()}_API_KEY"
    monkeypatch.setenv(variable, key)
    told = f"^{variable} in the environment: character {place} of {len(key)} "
    with pytest.raises(ChatSetupError, match=told) as caught:
        connect(f"{provider}/x", api_base="http://127.0.0.1/v1")
    assert "sk-" not in str(caught.value)


def test_an_address_of_the_environment_is_recorded_and_priced(monkeypatch: pytest.MonkeyPatch) -> None:
    own = LLMSettings(name="openai/gpt-5-mini")
    assert own.api_base is None and price_of(own) is not None
    monkeypatch.setenv("OPENAI_API_BASE", "http://127.0.0.1:1/v1")
    there = LLMSettings(name="openai/gpt-5-mini")
    assert there.api_base == "http://127.0.0.1:1/v1" and price_of(there) is None
    assert price_of(there.model_copy(update={"price": (1.0, 2.0)})) == Price(1.0, 2.0)
    assert LLMSettings.model_validate_json(own.model_dump_json()) == own  # what was recorded stays
    with pytest.raises(ChatSetupError, match=r"names http://127\.0\.0\.1:1/v1 now: unset OPENAI_BASE_URL"):
        open_chat(own)


def test_prices_that_are_listed_and_true_are_known() -> None:
    listed = litellm_adapter.listed_price("openai/gpt-5-mini")
    assert listed is not None and 0 < listed.prompt < listed.completion
    for llm in ("huggingface/openai/gpt-oss-20b", "openai/never-heard-of"):
        assert litellm_adapter.listed_price(llm) is None


@pytest.mark.parametrize(
    "host", ["sk-prod-eu-west-2.example.org/v1", "h/hf-inference/v1", "h/sk-learn-gateway-in-use"]
)
def test_an_address_that_only_begins_like_a_key_is_used_and_told(
    host: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_BASE_URL", f"https://{host}")
    assert open_chat(LLMSettings(name="openai/mine")).address == f"https://{host}"  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("private", "plain"),
    [
        ("http://me:word@127.0.0.1:1/v1", "http://127.0.0.1:1/v1"),
        ("http://127.0.0.1:1/v1?x=1&apikey=word12", "http://127.0.0.1:1/v1"),
        ("http://127.0.0.1:1/hf-ordinary/sk-abcdefghijklmnop1", "http://127.0.0.1:1/hf-ordinary/[redacted]"),
    ],
)
def test_an_address_is_recorded_without_its_password_and_used_with_it(
    private: str, plain: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_BASE", private)
    settings = LLMSettings(name="openai/mine")
    assert settings.api_base == plain
    chats = [open_chat(settings)]
    monkeypatch.setenv("OPENAI_API_BASE", "http://me:word@127.0.0.1:2/v1")
    chats.append(open_chat(settings))
    monkeypatch.delenv("OPENAI_API_BASE")
    chats.append(open_chat(settings))
    assert [chat.api_base for chat in chats] == [private, plain, plain]  # type: ignore[attr-defined]
    with pytest.raises(ChatSetupError, match="would be recorded; drop it"):
        connect("openai/mine", api_base=private)
    monkeypatch.setenv("OPENAI_API_BASE", "http://me:a/word@127.0.0.1:2/v1")
    with pytest.raises(ChatSetupError, match=r"OPENAI_API_BASE in the environment: .* as %2F") as caught:
        LLMSettings(name="openai/mine")
    assert "word@" not in str(caught.value)
    assert LLMSettings(name="/some/model.gguf").api_base is None  # it has a server of its own
    assert LLMSettings(name="~nobody-of-this-name/a.gguf").name.endswith("/~nobody-of-this-name/a.gguf")


@pytest.mark.parametrize(
    ("llm", "mode"),
    [
        # Grammars that break gpt-oss are not tried.
        ("ollama_chat/gpt-oss:20b", "prompt"),
        ("lm_studio/openai/gpt-oss-20b", "prompt"),
        ("huggingface/openai/gpt-oss-20b", "json_schema"),
        ("ollama_chat/qwen3", "bounded_schema"),
        ("openai/any", "bounded_schema"),
        ("anthropic/claude-sonnet-4-5", "json_schema"),
    ],
)
def test_the_first_way_of_asking_is_the_strictest_that_works(llm: str, mode: str) -> None:
    assert first_mode(llm) == mode


PAID = ChatReply(text="answer", usage=Usage(prompt_tokens=10, completion_tokens=5, cost=0.01), seconds=3.0)


class TestCache:
    def test_replies_of_one_server_are_not_those_of_another(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        places = []
        for server in ("127.0.0.1:1", "127.0.0.1:2", "me:word@127.0.0.1:1", "me:word@127.0.0.1:2"):
            monkeypatch.setenv("OPENAI_API_BASE", f"http://{server}/v1")
            chat = connect("openai/mine", cache=tmp_path)
            assert isinstance(chat, LiteLLMChat)
            places.append(chat._place(tmp_path, PLAIN))
        assert len(set(places)) == 4

    def test_valid_replies_are_kept_and_cost_nothing_again(self, tmp_path: Path) -> None:
        inner = ScriptedChat([PAID, "never"])
        chat = Served(server=inner, cache=tmp_path / "new" / "folder")
        reply = chat.complete(PLAIN)
        for _ in range(2):
            chat.accepted(PLAIN, reply)
        again = chat.complete(PLAIN)
        assert (again.text, again.source, again.usage) == ("answer", "cache", Usage(cost=0.0, kept=1))
        assert len(inner.requests) == 1
        assert [p.suffix for p in tmp_path.rglob("*") if p.is_file()] == [".json"]

    def test_rejected_replies_are_not_kept_and_damaged_ones_asked_for_again(self, tmp_path: Path) -> None:
        chat = Served(server=ScriptedChat(["bad", PAID, "anew"]), cache=tmp_path)
        assert chat.complete(PLAIN).text == "bad"
        chat.accepted(PLAIN, chat.complete(PLAIN))
        (file,) = tmp_path.rglob("*.json")
        file.write_text("{")
        assert chat.complete(PLAIN).text == "anew"

    def test_where_nothing_can_be_written_the_reply_counts_all_the_same(
        self, tmp_path: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        (tmp_path / "file").write_text("")
        chat = Served(server=ScriptedChat([PAID]), cache=tmp_path / "file" / "replies")
        assert converse(chat, PLAIN, str, lambda _: None) == "answer"
        assert f"cannot write to {tmp_path / 'file' / 'replies'}" in caplog.text

    def test_everything_that_is_sent_is_part_of_the_question(self, tmp_path: Path) -> None:
        kept = Served("a", server=ScriptedChat(["one"]), cache=tmp_path)
        kept.accepted(PLAIN, kept.complete(PLAIN))
        others = [
            (Served("a"), PLAIN.model_copy(update={"sample": 1})),
            (Served("a"), PLAIN.model_copy(update={"reply_schema": {"type": "object"}})),
            (Served("a"), PLAIN.model_copy(update={"messages": (Message(role="system", content="?"),)})),
            (Served("a", effort="low"), PLAIN),
            (Served("a", options={"temperature": 0}), PLAIN),
            (Served("b"), PLAIN),
        ]
        for chat, other in others:
            chat.cache, chat.server = tmp_path, ScriptedChat(["two"])
            assert chat.complete(other).text == "two"
