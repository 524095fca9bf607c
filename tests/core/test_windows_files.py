import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "win32", reason="needs Windows")


@pytest.fixture
def files() -> Any:
    """The module, which cannot be imported elsewhere."""
    return import_module("falsifier.core.windows_files")


def test_a_file_is_locked_once(files: Any, tmp_path: Path) -> None:
    first = files.lock_file(tmp_path / "lock")
    assert first is not None
    assert files.lock_file(tmp_path / "lock") is None


def test_a_file_takes_the_place_of_another_one(files: Any, tmp_path: Path) -> None:
    for name in ("old", "new"):
        (tmp_path / name).write_text(name)
    files.replace(tmp_path / "new", tmp_path / "old")
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("old", "new")]


def test_a_tree_with_protected_files_is_removed(files: Any, tmp_path: Path) -> None:
    (tmp_path / "tree" / "a").mkdir(parents=True)
    (tmp_path / "tree" / "a" / "file").touch()
    (tmp_path / "tree" / "a" / "file").chmod(0o400)
    files.remove_tree(tmp_path / "tree")
    assert not (tmp_path / "tree").exists()
