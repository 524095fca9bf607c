"""Keys stay where they belong: whatever repeats them, neither records nor terminal nor FMUs see them."""

import json
import string
from base64 import b64encode
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from falsifier.core.secrets import holds_credentials, redact, redact_held
from falsifier.errors import ChatSetupError
from falsifier.search.request import LLMSettings
from tests.command import Done, falsifier
from tests.hostile.servers import Behaviour, answers, completion, misbehaving, response, sends

KEY = "an-ordinary-looking-key"
OTHER = "another-plain-value"
LETTERS = string.ascii_letters + string.digits
PREFIXES = ["sk-", "hf_", "gsk_", "xai-", "nvapi-", "pplx-", "github_pat_", "ghp_", "glpat-", "xoxb-"]
KEYS = st.tuples(st.sampled_from(PREFIXES), st.text(LETTERS, min_size=20, max_size=60)).map("".join)
TEXTS = st.text(st.sampled_from(" .,;:'\"()\n=äx"), max_size=5)


@given(KEYS, TEXTS, TEXTS)
def test_well_known_keys_are_removed_from_any_message(key: str, before: str, after: str) -> None:
    assert key not in redact(f"{before} {key} {after}")


@given(st.text(LETTERS + "-_+/=. ", min_size=6, max_size=60), TEXTS)
def test_a_given_secret_is_removed_from_any_text(secret: str, around: str) -> None:
    if len(secret.strip()) >= 6:
        assert secret.strip() not in redact_held(f"{around}{secret}{around}", [secret]).replace(
            "[redacted]", ""
        )


def run(behaviour: Behaviour, folder: Path) -> Done:
    """A run with an LLM whose server does this, with keys in the environment."""
    with misbehaving(behaviour) as server:
        return falsifier(
            *("run", "AT1", "--llm", "openai/m", "--api-base", server.url, "--variant", "MP4"),
            *("--budget", "2", "--out", "run", "--llm-option", "cache=no"),
            cwd=folder,
            env={"OPENAI_API_KEY": KEY, "MY_PASSWORD": OTHER},
        )


def recorded(folder: Path) -> str:
    return "".join(p.read_text("utf-8", "replace") for p in folder.rglob("*.json*"))


SIGNALS = [{"name": "throttle", "values": [1] * 7}, {"name": "brake", "values": [1] * 3}]
REPEATS: dict[str, Behaviour] = {
    "a rationale": answers(json.dumps({"rationale": f"{KEY}, {OTHER}", "signals": SIGNALS})),
    "a rejected reply": answers(f"your key is {KEY} and your password is {OTHER}"),
    "a refusal": sends(
        response(json.dumps({"error": {"message": f"bad {KEY} {OTHER}"}}).encode(), status="401 X")
    ),
    "an error": sends(response(f"<html>{KEY} {OTHER}".encode(), status="418 X")),
    "a name": sends(response(completion("").replace(b'"m"', f'"{KEY}{OTHER}"'.encode()))),
    "a redirect": sends(response(b"", status="302 X", headers=f"location: http://{KEY}.{OTHER}/\r\n")),
}


@pytest.mark.parametrize("where", REPEATS)
def test_a_key_that_is_repeated_is_neither_recorded_nor_shown(tmp_path: Path, where: str) -> None:
    done = run(REPEATS[where], tmp_path)
    seen = done.out + done.err + recorded(tmp_path)
    assert "openai/m" in seen
    assert KEY not in seen and OTHER not in seen
    if where == "a rationale":
        assert "[redacted], [redacted]" in recorded(tmp_path)


def test_what_a_model_says_cannot_act_on_the_terminal(tmp_path: Path) -> None:
    reply = json.dumps({"rationale": "\x1b]0;owned\x07\x1b[2Jplain\u202e", "signals": SIGNALS})
    done = run(answers(reply), tmp_path)
    assert '"rationale":"plain"' in recorded(tmp_path).replace('": "', '":"')
    seen = done.out + done.err
    assert "samples" in seen or "simulation" in seen
    assert "owned" not in seen and "\x1b[2J" not in seen and "\u202e" not in seen


PASSWORD = "a-plain-password"


@pytest.mark.parametrize("at", ["http://me:{}@127.0.0.1:9/v1", "me:{}@host/v1", "http://me:a/{}@host/v1"])
@pytest.mark.parametrize(
    "command",
    [
        ("run", "AT1", "--llm", "openai/m", "--out", "run", "--api-base"),
        ("bench", "AT1", "--llm", "openai/m", "--out", "run", "--yes", "--api-base"),
        ("llm", "check", "openai/m", "--api-base"),
        ("formalize", "AT1", "fast", "--llm", "openai/m", "--api-base"),
    ],
    ids=lambda command: " ".join((command[0], command[-1])),
)
def test_an_address_with_a_password_is_refused_and_not_repeated(
    tmp_path: Path, command: tuple[str, ...], at: str
) -> None:
    done = falsifier(*command, at.format(PASSWORD), cwd=tmp_path, code=2)
    assert f"{command[-1]}:" in done.err
    assert "environment variable OPENAI_API_BASE" in done.err
    assert PASSWORD not in done.out + done.err + recorded(tmp_path)


def test_an_option_with_a_password_is_refused() -> None:
    with pytest.raises(ValueError, match="base_url: contains a user name or a password") as caught:
        LLMSettings(name="openai/m", options={"base_url": f"http://me:{PASSWORD}@host"})
    assert PASSWORD not in str(caught.value)
    with pytest.raises(ChatSetupError, match="environment variable HOSTED_VLLM_API_BASE"):
        LLMSettings(name="hosted_vllm/m", api_base=f"http://me:{PASSWORD}@host")


def test_an_address_in_the_environment_is_used_with_its_password_and_shown_without(tmp_path: Path) -> None:
    page = response(f"<html>{PASSWORD}, me:{PASSWORD}".encode(), status="418 X")
    with misbehaving(sends(page)) as server:
        address = server.url.replace("://", f"://me:{PASSWORD}@")
        done = falsifier(
            *("run", "AT1", "--llm", "openai/m", "--budget", "2", "--out", "run", "--llm-option", "cache=no"),
            cwd=tmp_path,
            env={"OPENAI_API_BASE": address, "HTTP_PROXY": "", "http_proxy": ""},
        )
        sent = b64encode(f"me:{PASSWORD}".encode())
        assert server.requests and all(b"Basic " + sent in request for request in server.requests)
    seen = done.out + done.err + recorded(tmp_path)
    assert "[redacted]" in seen
    assert PASSWORD not in seen


@given(st.text(LETTERS + "/:@-_.", min_size=6, max_size=20), st.text(LETTERS + "/:-_.", max_size=20))
def test_credentials_in_an_address_are_found_and_addresses_without_them_stay(word: str, path: str) -> None:
    # Digits and a slash would be a port and a path.
    assert holds_credentials(f"http://me:x{word}@host/{path}")
    assert holds_credentials(f"me:x{word}@host/{path}")
    assert holds_credentials(f"http://host/v1?a=b&api_key=x{word}")
    assert not holds_credentials(f"http://host:8000/{path}@x")
    assert not holds_credentials(f"http://[::1]:8000/{path}")
