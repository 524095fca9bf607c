import pytest

from falsifier.fmu.environment import scrubbed


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
