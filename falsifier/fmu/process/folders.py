"""Temporary folders of FMU processes: removed in any state, and swept if their owner was killed."""

import contextlib
import os
import re
import tempfile
import time
from pathlib import Path
from uuid import uuid4

from falsifier.core import posix_files

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
        self._lock = posix_files.lock_file(_lock_of(self.path))
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
    posix_files.remove_tree(path)
    with contextlib.suppress(OSError):
        _lock_of(path).unlink()


def sweep() -> None:
    """Remove the folders of processes that were killed before they could do so."""
    temporary = Path(tempfile.gettempdir())
    for path in temporary.glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):
            if not (_MADE.fullmatch(path.name) and path.lstat().st_uid == os.getuid()):
                continue
            if path.name.endswith(_LOCK_SUFFIX):
                _sweep_lock(path)
            else:
                _sweep_folder(path)


def _lock_of(path: Path) -> Path:
    return path.with_name(path.name + _LOCK_SUFFIX)


def _sweep_folder(path: Path) -> None:
    lock = posix_files.lock_file(_lock_of(path))
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
