import json
import os
import tempfile
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings, strategies as st

from falsifier.core import posix_files
from falsifier.core.files import check_seal, checksum, private_folder, remove_partial, seal, write_whole


def test_text_and_bytes_are_written_into_folders_that_are_made(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "a.txt"
    assert write_whole(path, "grüß\n") == path
    assert path.read_bytes() == "grüß\n".encode()
    write_whole(path, b"\0\1")
    assert path.read_bytes() == b"\0\1"
    assert list(path.parent.iterdir()) == [path], "nothing else is left"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_leaves_the_old_content_and_nothing_partial(tmp_path: Path) -> None:
    path = write_whole(tmp_path / "a.txt", "old")
    partial = path.with_name(f"a.txt.{os.getpid()}.partial")
    partial.symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left on device"):
        write_whole(path, "new")
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("pid", [os.getpid(), 2**22 + 7], ids=["own", "dead"])
def test_what_a_killed_process_has_left_is_removed_by_its_exact_name(tmp_path: Path, pid: int) -> None:
    running = os.getppid()
    kept = [
        tmp_path / name
        for name in (
            f"1-ab.npz.{running}.partial", "1-ab.npz.partial", f"notes.npz.{pid}.partial", "1-ab.npz",
            f"1-ab.npz.{pid}.partial.bak", f"1-ab.npz.0{pid}.partial",
        )
    ]  # fmt: skip
    link = tmp_path / f"2-cd.npz.{pid}.partial"
    folder = tmp_path / f"3-ef.npz.{pid}.partial"
    left = tmp_path / f"1-ab.npz.{pid}.partial"
    for path in (*kept, left):
        path.touch()
    link.symlink_to(kept[0])
    folder.mkdir()
    remove_partial(tmp_path, r"\d+-[0-9a-f]+\.npz")
    assert {*tmp_path.iterdir()} == {*kept, link, folder}
    remove_partial(tmp_path / "none", r"\d+")


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders have no owner here")
def test_a_folder_that_others_can_write_to_is_not_private(tmp_path: Path) -> None:
    own = private_folder(tmp_path / "a" / "own")
    assert own is not None and own.stat().st_mode & 0o777 == 0o700
    own.chmod(0o777)
    assert private_folder(own) is None


OTHER_KEYS = st.text().filter(lambda key: key != "sum")


@given(st.dictionaries(OTHER_KEYS, st.integers() | st.text(), min_size=1), st.sampled_from([None, 2]))
def test_a_sealed_object_is_the_object_and_a_checksum(content: dict[str, object], indent: int | None) -> None:
    sealed = seal(json.dumps(content, indent=indent))
    check_seal(sealed.encode())
    loaded = json.loads(sealed)
    assert list(loaded)[-1] == "sum"
    assert {**content, "sum": loaded["sum"]} == loaded


def test_every_flipped_bit_but_in_the_last_blanks_is_noticed() -> None:
    sealed = seal('{"a":1,"b":"text"}').encode()
    for position in range(8 * (len(sealed) - 1)):
        damaged = bytearray(sealed)
        damaged[position // 8] ^= 1 << position % 8
        with pytest.raises(ValueError, match="checksum"):
            check_seal(bytes(damaged))


def test_what_has_no_checksum_is_refused() -> None:
    for content in (b"", b"{}", b'{"a":1}', Random(1).randbytes(1000)):
        with pytest.raises(ValueError, match="does not end with a checksum"):
            check_seal(content)
    assert checksum(b"") != checksum(b"0")


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
    assert not root.exists()
    root.symlink_to(tmp_path / "kept")
    posix_files.remove_tree(root)
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
