from pathlib import Path

import pytest

from falsifier.errors import ModelError
from falsifier.fmu.description import wine


def test_paths_are_on_the_drive_that_stands_for_this_machine() -> None:
    assert wine.windows_path(Path("/tmp/ä b/x.dll")) == "Z:\\tmp\\ä b\\x.dll"


@pytest.mark.parametrize("character", ["\\", '"'])
def test_paths_that_windows_programs_cannot_open_are_refused(character: str) -> None:
    with pytest.raises(ModelError, match="set TMPDIR to another folder"):
        wine.windows_path(Path(f"/tmp/a{character}b/x.dll"))


def test_the_libraries_of_wine_are_found_from_its_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "usr" / "bin" / "wine64"
    own = tmp_path / "usr" / "lib" / "x86_64-linux-gnu" / "wine" / "x86_64-windows"
    for place in (program, own / "Kernel32.dll", own / "msvcrt.dll"):
        place.parent.mkdir(parents=True, exist_ok=True)
        place.touch()
    monkeypatch.setattr(wine, "find_wine", lambda: program)
    look = wine.wine_libraries.__wrapped__
    assert look() == {"kernel32.dll", "msvcrt.dll"}
    monkeypatch.setattr(wine, "find_wine", lambda: None)
    assert look() == frozenset()
