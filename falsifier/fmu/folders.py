"""Temporary folders of FMU processes: removed in any state, and swept if their owner was killed."""

import contextlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from uuid import uuid4

from falsifier.fmu import posix

_PREFIX = "falsifier-fmu-"
_LOCK_SUFFIX = ".lock"
# Only what this module has made is swept.
_MADE = re.compile(rf"{_PREFIX}[0-9a-f]{{32}}({re.escape(_LOCK_SUFFIX)})?")
# A lock without a folder belongs to a process that is about to make the folder, unless it is older than this.
_MAKING_SECONDS = 3600.0


class WorkFolder:
    """A folder in the system's temporary folder, with a lock beside it that says that its owner is alive."""

    def __init__(self) -> None:
        self.path = Path(tempfile.gettempdir()) / f"{_PREFIX}{uuid4().hex}"
        # Locked before the folder exists: a folder whose lock is free has lost its owner.
        self._lock = posix.lock_file(_lock_of(self.path))
        self.path.mkdir(mode=0o700)

    def remove(self) -> None:
        """Remove the folder with all its contents, and the lock."""
        remove_work_folder(self.path)
        self.forget()

    def forget(self) -> None:
        """Leave the folder to another process, such as the one that this is a copy of."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def remove_work_folder(path: Path) -> None:
    """Remove a folder that a WorkFolder made, perhaps in another process, and its lock."""
    remove_tree(path)
    with contextlib.suppress(OSError):
        _lock_of(path).unlink()


def sweep() -> None:
    """Remove the folders of processes that were killed before they could do so."""
    temporary = Path(tempfile.gettempdir())
    for path in temporary.glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):
            if not (_MADE.fullmatch(path.name) and _is_mine(path)):
                continue
            if path.name.endswith(_LOCK_SUFFIX):
                _sweep_lock(path)
            else:
                _sweep_folder(path)


def remove_tree(path: Path) -> None:
    """Remove a folder with all its contents, however deep and whatever its permissions; ignore errors."""
    if os.scandir not in os.supports_fd or os.rename not in os.supports_dir_fd:
        shutil.rmtree(path, ignore_errors=True)
        return
    try:
        folder = _opened(path)
    except OSError:
        return
    try:
        _empty(folder)
    finally:
        os.close(folder)
    with contextlib.suppress(OSError):
        path.rmdir()


def _opened(path: Path) -> int:
    flags = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW
    try:
        return os.open(path, flags)
    except PermissionError:
        path.chmod(0o700)
        return os.open(path, flags)


def _lock_of(path: Path) -> Path:
    return path.with_name(path.name + _LOCK_SUFFIX)


def _is_mine(path: Path) -> bool:
    return not hasattr(os, "getuid") or path.lstat().st_uid == os.getuid()


def _sweep_folder(path: Path) -> None:
    lock = posix.lock_file(_lock_of(path))
    if lock is not None:
        try:
            remove_work_folder(path)
        finally:
            os.close(lock)


def _sweep_lock(path: Path) -> None:
    if not path.with_name(path.name.removesuffix(_LOCK_SUFFIX)).exists():
        age = time.time() - path.lstat().st_mtime
        if age > _MAKING_SECONDS:
            path.unlink()


def _empty(folder: int) -> None:
    """Remove the contents of an open folder.

    Folders in folders are moved up into the open one. So paths stay short, few files are open, and nothing
    recurs, even with thousands of folders in each other.
    """
    names = (f"{uuid4().hex}-{number}" for number in count())
    seen: set[str] = set()
    while entries := set(_names(folder)) - seen:
        for entry in entries:
            if not _unlinked(entry, folder):
                _hoist(entry, folder, names)
                with contextlib.suppress(OSError):
                    os.rmdir(entry, dir_fd=folder)
        # What is still there cannot be removed.
        seen |= entries


def _hoist(entry: str, folder: int, names: Iterator[str]) -> None:
    """Remove the files in a folder of an open folder, and move its folders up."""
    with contextlib.suppress(OSError):
        os.chmod(entry, 0o700, dir_fd=folder)
        inner = os.open(entry, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=folder)
        try:
            for name in _names(inner):
                if not _unlinked(name, inner):
                    with contextlib.suppress(OSError):
                        os.chmod(name, 0o700, dir_fd=inner)
                        os.rename(name, next(names), src_dir_fd=inner, dst_dir_fd=folder)
        finally:
            os.close(inner)


def _names(folder: int) -> list[str]:
    with os.scandir(folder) as entries:
        return [entry.name for entry in entries]


def _unlinked(name: str, folder: int) -> bool:
    """Remove a file; return False for a folder."""
    try:
        os.unlink(name, dir_fd=folder)
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return True
