import os
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from falsifier.core import posix_files

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="these are services of Linux")


@LINUX
def test_a_sealed_file_keeps_its_size() -> None:
    with posix_files.sealed_file(4096) as file:
        assert os.fstat(file.fileno()).st_size == 4096
        for size in (0, 8192):
            with pytest.raises(PermissionError):
                os.ftruncate(file.fileno(), size)


@LINUX
def test_whether_a_folder_forbids_programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = os.statvfs(tmp_path)
    for flag in (0, os.ST_NOEXEC):
        fields = [*known[:8], flag, *known[9:]]
        monkeypatch.setattr(os, "statvfs", lambda folder, fields=fields: os.statvfs_result(fields))
        assert posix_files.forbids_programs(tmp_path) == bool(flag)


def test_a_file_is_locked_once(tmp_path: Path) -> None:
    first = posix_files.lock_file(tmp_path / "lock")
    assert first is not None
    assert posix_files.lock_file(tmp_path / "lock") is None
    os.close(first)
    second = posix_files.lock_file(tmp_path / "lock")
    assert second is not None
    os.close(second)


def test_a_lock_is_not_taken_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "lock").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OSError, match="lock"):
        posix_files.lock_file(tmp_path / "lock")
    assert not (tmp_path / "elsewhere").exists()


def test_a_tree_deeper_than_recursion_goes_is_removed(tmp_path: Path) -> None:
    root = tmp_path / "deep"
    root.mkdir()
    here = os.open(root, os.O_RDONLY)
    for _ in range(1200):
        os.mkdir("a", dir_fd=here)
        below = os.open("a", os.O_RDONLY, dir_fd=here)
        os.close(here)
        here = below
    os.close(here)
    posix_files.remove_tree(root)
    assert not root.exists()


def test_links_are_removed_and_not_followed(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "file").touch()
    root = tmp_path / "tree"
    root.mkdir()
    (root / "link").symlink_to(tmp_path / "kept")
    (root / "nowhere").symlink_to("nowhere")
    posix_files.remove_tree(root)
    assert not root.exists() and (tmp_path / "kept" / "file").exists()


def test_a_link_in_place_of_the_folder_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "kept")
    posix_files.remove_tree(tmp_path / "link")
    assert (tmp_path / "kept" / "file").exists()


TREES = st.lists(
    st.tuples(st.lists(st.sampled_from("ab\n"), min_size=1, max_size=5), st.integers(0, 0o777)), max_size=8
)


@settings(max_examples=50, deadline=None)
@given(TREES)
def test_any_tree_with_any_permissions_is_removed(trees: list[tuple[list[str], int]]) -> None:
    root = Path(tempfile.mkdtemp())
    for parts, mode in trees:
        folder = root.joinpath(*parts)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "file").touch()
        (folder / "file").chmod(mode)
    for parts, mode in trees:
        root.joinpath(*parts).chmod(mode)
    posix_files.remove_tree(root)
    assert not root.exists()
