"""What FMUs see of the environment."""

from pathlib import Path

import pytest

from falsifier.core import operating_system
from falsifier.fmu.process.program import MORE, protect_secrets, worker_environment

GIVEN = {
    "PATH": "/bin",
    "LC_ALL": "de_DE.UTF-8",
    "LM_LICENSE_FILE": "27000@server",
    "OPENAI_API_KEY": "a key",
    "MY_MODEL_DATA": "/data",
    "TMPDIR": "/elsewhere",
    "OMP_NUM_THREADS": "8",
}


def test_fmus_see_what_libraries_need_and_nothing_else() -> None:
    seen = worker_environment(GIVEN, Path("/work"))
    kept = ("PATH", "LC_ALL", "LM_LICENSE_FILE")
    assert {name: seen.pop(name) for name in kept} == {name: GIVEN[name] for name in kept}
    assert seen.pop("OMP_NUM_THREADS") == "1"
    assert {seen.pop(name) for name in ("TMPDIR", "TEMP", "TMP")} == {"/work"}
    assert seen.keys() <= {"OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"}


def test_further_variables_are_passed_on_by_name_but_no_keys() -> None:
    seen = worker_environment({**GIVEN, MORE: "MY_MODEL_DATA, OPENAI_API_KEY"}, Path("/work"))
    assert seen["MY_MODEL_DATA"] == "/data" and "OPENAI_API_KEY" not in seen


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
