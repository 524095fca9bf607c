import pytest

from falsifier.core.secrets import line_of_secret, redact, scrubbed, without_secrets

KEYS = (
    "hf_abcdefghijklmnopqrst",
    "gsk_abcdefghijklmnopqrst",
    "xai-abcdefghijklmnopqrst",
    "nvapi-abcdefghijklmnopqrst",
    "github_pat_abcdefghijklmnopqrst",
    "glpat-abcdefghijklmnopqrst",
    "sk-ant-abcdefghijklmnopqrst",
)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("OPENAI_API_KEY", "x"),
        ("anthropic_api_key", "x"),
        ("AWS_SESSION_TOKEN", "x"),
        ("DB_PASSWORD", "x"),
        ("GOOGLE_APPLICATION_CREDENTIALS", "/key.json"),
        ("SSH_AUTH_SOCK", "/tmp/agent"),
        ("MY_SECRET", "x"),
        ("HTTPS_PROXY", "http://user:pass@proxy:3128"),
        ("ENDPOINT", "sk-proj-abcdefghijklmnopqrstuvwx"),
        ("PLAIN", "ghp_abcdefghijklmnopqrstuvwxyz"),
        ("MYPASS", "x"),
        ("GH_PAT", "x"),
        ("SESSION_JWT", "x"),
        *(("PLAIN", key) for key in KEYS),
    ],
)
def test_secrets_are_taken_out(name: str, value: str) -> None:
    assert scrubbed({name: value}) == {}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("PATH", "/usr/bin"),
        ("LD_LIBRARY_PATH", "/opt/matlab/lib"),
        ("LM_LICENSE_FILE", "27000@licenses"),
        ("DYMOLA_RUNTIME_LICENSE", "/opt/license.lic"),
        ("OPENMODELICAHOME", "/opt/om"),
        ("HTTPS_PROXY", "http://proxy:3128"),
        ("TMPDIR", "/tmp"),
    ],
)
def test_what_models_need_stays(name: str, value: str) -> None:
    assert scrubbed({name: value}) == {name: value}


@pytest.mark.parametrize("key", KEYS)
def test_keys_are_taken_out_of_texts(key: str) -> None:
    assert redact(f"refused: {key}, try again") == "refused: [redacted], try again"


def test_options_that_may_hold_a_key_are_recorded_without_it() -> None:
    options = {"extra_body": {"key": "s"}, "headers": {"X": "s"}, "aws_secret": "s", "max_tokens": 5}
    assert without_secrets(options) == {
        "extra_body": "[redacted]",
        "headers": "[redacted]",
        "aws_secret": "[redacted]",
        "max_tokens": 5,
    }


@pytest.mark.parametrize("key", KEYS)
def test_the_line_of_a_secret_is_found(key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert line_of_secret(f"gain = 3\n\nlimit = {key}") == 3
    assert line_of_secret("The password must be given.\ntokens: 4000\nAPI_KEY=...\nkeys = [1, 2]") is None
    assert line_of_secret('{"client_secret": "abcdefgh"}') == 1
    monkeypatch.setenv("MY_TOKEN", "quite an ordinary value")
    assert line_of_secret("a\nb = quite an ordinary value") == 2
