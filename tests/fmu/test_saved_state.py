from collections.abc import Callable

import pytest

from falsifier.fmu.library import Library
from tests.fmu.fixtures import local, run


def test_a_saved_state_is_taken_once_and_freed_before_its_instance(monkeypatch: pytest.MonkeyPatch) -> None:
    called = []
    look_up = Library.function

    def function(library: Library, name: str, *types: object) -> Callable[..., int]:
        called.append(name)
        return look_up(library, name, *types)

    monkeypatch.setattr(Library, "function", function)
    model = local("SavedState_3")
    for _ in range(3):
        run(model, ("y",))
    model.close()
    kept = [name for name in called if "FMUState" in name or name == "FreeInstance"]
    tested, used = ["SetFMUState"] * 2, ["SetFMUState"] * 2
    # The first instance goes after its reset was found to be none.
    assert kept == ["FreeInstance", "GetFMUState", *tested, *used, "FreeFMUState", "FreeInstance"]
