from pathlib import Path

import pytest

from falsifier.errors import ModelError
from falsifier.fmu import wine


def test_paths_are_on_the_drive_that_stands_for_this_machine() -> None:
    assert wine.windows_path(Path("/tmp/ä b/x.dll")) == "Z:\\tmp\\ä b\\x.dll"


@pytest.mark.parametrize("character", ["\\", '"'])
def test_paths_that_windows_programs_cannot_open_are_refused(character: str) -> None:
    with pytest.raises(ModelError, match="set TMPDIR to another folder"):
        wine.windows_path(Path(f"/tmp/a{character}b/x.dll"))
