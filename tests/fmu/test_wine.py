from pathlib import Path

from falsifier.fmu import wine


def test_paths_are_on_the_drive_that_stands_for_this_machine() -> None:
    assert wine.windows_path(Path("/tmp/ä b/x.dll")) == "Z:\\tmp\\ä b\\x.dll"
