"""Files without names, locks, and folders that are removed in any state, on Linux and macOS."""

import contextlib
import fcntl
import os
import pwd
import sys
import tempfile
from collections.abc import Iterator
from io import FileIO
from itertools import count
from pathlib import Path
from uuid import uuid4


def unnamed_file() -> FileIO:
    """Open a file without a name, in memory if the system supports that."""
    if sys.platform == "linux" and hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("falsifier-fmu", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        return FileIO(descriptor, "w+b")
    return tempfile.TemporaryFile(buffering=0)


def enlarge(file: FileIO, size: int) -> None:
    """Make a file that is shared with the processes of FMUs larger, to this size in bytes.

    Raises:
        OSError: if it is larger than files of this process may be, or there is no room.
    """
    try:
        file.truncate(size)
    except OSError as error:
        error.filename = "memory shared with the processes of FMUs"  # the file itself has no name
        raise


def sealed_file(size: int) -> FileIO:
    """Open a file without a name of this size in bytes, which no process can change if it is in memory.

    A file that grows fills the memory.

    Raises:
        OSError: as for ``enlarge``.
    """
    file = unnamed_file()
    enlarge(file, size)
    if sys.platform == "linux" and hasattr(os, "memfd_create"):
        fcntl.fcntl(file, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL)
    return file


def lock_file(path: Path) -> int | None:
    """Create and lock a file; the lock ends with the last process that has the returned descriptor open.

    Returns:
        The descriptor; None if another process has locked the file.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return None
    return descriptor


def homes() -> tuple[Path, ...]:
    """Return the user's home folder: what the environment says, and what the system says; none if unknown."""
    found = []
    with contextlib.suppress(RuntimeError):
        found.append(Path.home())
    with contextlib.suppress(KeyError):
        found.append(Path(pwd.getpwuid(os.getuid()).pw_dir))
    return tuple(dict.fromkeys(found))


def forbids_programs(folder: Path) -> bool:
    """Whether the file system of a folder is mounted so that nothing in it is executed or loaded."""
    return bool(os.statvfs(folder).f_flag & getattr(os, "ST_NOEXEC", 0))


def remove_tree(path: Path) -> None:
    """Remove a folder with all its contents, however deep and whatever its permissions; ignore errors."""
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
