import pytest

from falsifier.core.secrets import line_of_held_secret, line_of_secret, scrubbed, without_secrets

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
        ("myPASSPHRASE", "x"),
        ("A_B_CREDENTIALS_1", "x"),
        ("MY_ACCESS_KEYS", "x"),
        ("ADDRESS", "https://me:hunter22@host"),
        ("ADDRESS", "https://host/v1?x=1&sig=hunter22"),
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


def test_options_that_may_hold_a_key_are_recorded_without_it() -> None:
    options = {"extra_body": {"key": "s"}, "headers": {"X": "s"}, "aws_secret": "s", "max_tokens": 5}
    assert without_secrets(options) == {
        "extra_body": "[redacted]",
        "headers": "[redacted]",
        "aws_secret": "[redacted]",
        "max_tokens": 5,
    }


def test_the_line_of_a_held_secret_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MY_TOKEN", "quite an ordinary value")
    assert line_of_held_secret("a\nb = quite an ordinary value") == 2
    monkeypatch.setenv("MY_KEY", "one of\ntwo lines\n")
    assert line_of_held_secret("a\nb\nc = one of\ntwo lines") == 3


@pytest.mark.parametrize(
    "line",
    [
        "aws_secret_access_key = abcdefghijk/lmno",
        "SECRET_KEY=abcdefgh123",
        "export GITHUB_TOKEN='abcdefgh1234'",
        "DB_PASS=hunter2hunter2",
        "Endpoint=sb://x;SharedAccessKey=abcdefghijk==",
        "clientSecret: 'abcdefgh'",
        '<P Name="password">hunter22</P>',
        '#define WIFI_PASSWORD "hunter22"',
        "// the password is hunter22",
        "Passwort: hunter22",
        "DB-Kennwort = 'hunter22'",
        "-----BEGIN PGP PRIVATE KEY BLOCK-----",
        "PuTTY-User-Key-File-3: ssh-ed25519",
        "sk_live_abcdefgh12345678",
        "ASIAABCDEFGHIJKLMNOP",
        f"npm_{'a1' * 18}",
        '{"client_secret": "abcdefgh"}',
        "-----BEGIN RSA PRIVATE KEY-----",
        "https://me:secret1@example.org/a",
        "https://example.org/a?token=secret1",
        f"https://example.org/{'a' * 300}?clientsecret=secret1",
        "Authorization: Bearer abcdefgh",
        *(f"GET /v1?x=1&{name}=abcdefgh" for name in ("sig", "signature", "auth", "pwd", "code")),
        *(f"limit = {key}" for key in KEYS),
    ],
)
def test_secrets_of_settings_sources_and_key_files_are_found(line: str) -> None:
    assert line_of_secret(f"gain = 3\n{line}\n") == 2
    assert line_of_secret(f"\fgain = 3\u2028\r\n{line}\r\n") == 2, "a line as editors count them"


@pytest.mark.parametrize(
    "line",
    [
        "the password is required for entry",
        "das Passwort wird beim Start verlangt",
        "tokens: 4000",
        "API_KEY=...",
        "keys = [1, 2]",
        "token = next_token;",
        "NEXT_TOKEN=(state + 1) * 2;",
        "#define MAX_TOKEN 1000000",
        "#define KEY_STATE_KEY (BASE + 100000)",
        "BlockKey = 12345678",
        "secret > threshold",
        '#define INSTANTIATION_TOKEN "{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}"',
        "INSTANTIATION_TOKEN=8c4e810f-3df3-4a00-8276-176fa3c9f9e0",
        "password=argv[1];",
        "password = getenv(NAME);",
        "const char *password = config->password;",
        "https://example.org/a?api-version=2024-10-21&monkey=banana",
        "https://example.org/a?sort_key=name",
        "Authorization: mailto:someone@example.org",
        '<a href="mailto://someone@example.org">',
    ],
)
def test_code_that_only_speaks_of_keys_is_no_secret(line: str) -> None:
    assert line_of_secret(line) is None
