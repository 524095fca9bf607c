import os
import time
from pathlib import Path

import pytest

from falsifier.fmu.process.start import _DROPPED, _MOST_BYTES, Output
from falsifier.fmu.process.workplace import WorkFolder, sweep
from tests.fmu import fixtures


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def test_a_folder_is_removed_with_its_lock(temporary: Path) -> None:
    folder = WorkFolder()
    (folder.path / "a" / "b").mkdir(parents=True)
    folder.remove()
    assert list(temporary.iterdir()) == []


def test_the_folder_may_have_any_name(temporary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (odd := temporary / os.fsdecode(b"\xff")).mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(odd))
    assert fixtures.run(fixtures.isolated("Lag_2"), ("x",))["x"][-1] == 0.0


def test_a_folder_whose_owner_lives_is_not_swept() -> None:
    folder = WorkFolder()
    sweep()
    assert folder.path.is_dir()
    folder.remove()


@pytest.mark.parametrize("name", ["falsifier-fmu-mine", "falsifier-fmu-" + "g" * 32, "falsifier-build-x"])
def test_nothing_else_is_swept(temporary: Path, name: str) -> None:
    (temporary / name).mkdir()
    sweep()
    assert (temporary / name).is_dir()


def test_a_lock_without_folder_is_swept_when_it_is_old(temporary: Path) -> None:
    young, old = (temporary / f"falsifier-fmu-{digit * 32}.lock" for digit in "ab")
    for lock in (young, old):
        lock.touch()
    os.utime(old, (time.time() - 10_000, time.time() - 10_000))
    sweep()
    assert list(temporary.iterdir()) == [young]


def test_of_much_output_the_end_is_taken() -> None:
    output = Output()
    os.write(output.file.fileno(), b"first\n" + b"x" * 100_000 + b"\nlast\n")
    lines = output.take()
    assert lines[-1] == "last"
    assert "first" not in lines
    output.file.close()


def test_no_process_can_make_it_longer_or_shorter() -> None:
    output = Output()
    written = 0
    with pytest.raises(PermissionError):
        while True:
            written += os.write(output.file.fileno(), b"x" * 99_999)
    assert written == _MOST_BYTES
    for size in (0, 2 * _MOST_BYTES):
        with pytest.raises(PermissionError):
            os.ftruncate(output.file.fileno(), size)
    assert output.take()[-1] == _DROPPED
    os.write(output.file.fileno(), b"again\n")
    assert output.take() == ("again",)
    output.file.close()


@pytest.mark.parametrize("position", [1, _MOST_BYTES, 1 << 60])
def test_a_moved_position_does_no_harm(position: int) -> None:
    output = Output()
    os.lseek(output.file.fileno(), position, os.SEEK_SET)
    assert sum(map(len, output.take())) < _MOST_BYTES
    os.write(output.file.fileno(), b"again\n")
    assert output.take() == ("again",)
    output.file.close()
