import pytest

from falsifier.core import operating_system
from falsifier.fmu.environment import protect_secrets, worker_environment


@pytest.mark.parametrize(
    ("name", "confines", "hides"),
    [("OPENAI_API_KEY", False, 1), ("OPENAI_API_KEY", True, 0), ("PATH", False, 0), ("PATH", True, 0)],
)
def test_memory_is_hidden_if_it_holds_secrets_and_fmus_are_not_confined(
    monkeypatch: pytest.MonkeyPatch, name: str, confines: bool, hides: int
) -> None:
    calls: list[None] = []
    monkeypatch.setattr(operating_system, "can_confine", lambda: confines)
    monkeypatch.setattr(operating_system, "hide_memory", lambda: calls.append(None))
    protect_secrets({name: "value"})
    assert len(calls) == hides


def test_everything_is_passed_on_but_secrets() -> None:
    given = {"PATH": "/usr/bin", "LM_LICENSE_FILE": "27000@licenses", "OPENAI_API_KEY": "x"}
    seen = worker_environment(given)
    assert (seen["PATH"], seen["LM_LICENSE_FILE"]) == ("/usr/bin", "27000@licenses")
    assert "OPENAI_API_KEY" not in seen
    assert given == {"PATH": "/usr/bin", "LM_LICENSE_FILE": "27000@licenses", "OPENAI_API_KEY": "x"}


def test_each_process_computes_in_one_thread() -> None:
    threads = [name for name in worker_environment({"OMP_NUM_THREADS": "8"}) if name.endswith("_NUM_THREADS")]
    assert len(threads) >= 3
    assert {worker_environment({"OMP_NUM_THREADS": "8"})[name] for name in threads} == {"1"}
