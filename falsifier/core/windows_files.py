"""Files and folders on Windows; see ``windows``."""

import contextlib
import msvcrt
import os
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

assert sys.platform == "win32"

# A file that another program, such as a virus scanner, has open cannot be replaced until that closes it.
_REPLACING_SECONDS = 2.0


def sealed_file(size: int, *, may_grow: bool = False) -> IO[bytes]:
    """Open a temporary file of this size that is removed when it is closed; the size is not sealed here."""
    del may_grow
    file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115
    file.truncate(size)
    return file


def lock_file(path: Path) -> int | None:
    """Create and lock a file; the lock ends with the process, or when the returned descriptor is closed.

    Returns:
        The descriptor; None if another process has locked the file.
    """
    if path.is_symlink():
        raise OSError(f"{path} is a link")
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOINHERIT, 0o600)
    try:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def can_seal() -> bool:
    """Return False: see ``sealed_file``."""
    return False


def write_at(descriptor: int, data: bytes, position: int) -> None:
    """Write bytes to a position of a file; the file's own is the same afterwards."""
    before = os.lseek(descriptor, 0, os.SEEK_CUR)
    try:
        os.lseek(descriptor, position, os.SEEK_SET)
        os.write(descriptor, data)
    finally:
        os.lseek(descriptor, before, os.SEEK_SET)


def read_at(descriptor: int, most: int, position: int) -> bytes:
    """Read at most this many bytes of a file from a position; the file's own is the same afterwards."""
    before = os.lseek(descriptor, 0, os.SEEK_CUR)
    try:
        os.lseek(descriptor, position, os.SEEK_SET)
        return os.read(descriptor, most)
    finally:
        os.lseek(descriptor, before, os.SEEK_SET)


def replace(source: Path, target: Path) -> None:
    """Put a file in the place of another one, atomically; wait a moment for programs that have it open."""
    until = time.monotonic() + _REPLACING_SECONDS
    while True:
        try:
            source.replace(target)
        except PermissionError:
            if time.monotonic() > until or target.is_dir():
                raise
            time.sleep(0.02)
        else:
            return


def user() -> str:
    """Return what tells this user's temporary folders from those of others: nothing, they are apart."""
    return "user"


def homes() -> tuple[Path, ...]:
    """Return the user's home folder."""
    return (Path.home(),)


def is_root() -> bool:
    """Return False: no user reads all files here."""
    return False


def is_own(path: Path) -> bool:
    """Whether a file or folder belongs to this user: each user has a temporary folder of their own."""
    return path.exists()


def is_private(folder: Path) -> bool:
    """Whether no other user can write to a folder: so for temporary ones."""
    return folder.is_dir()


def forbids_programs(folder: Path) -> bool:
    """Return False: no folder does."""
    return False


def remove_tree(path: Path) -> None:
    """Remove a folder with all its contents, files that are write-protected included; ignore errors."""

    def unprotect(remove: Callable[[str], Any], name: str, _error: object) -> None:
        with contextlib.suppress(OSError):
            Path(name).chmod(stat.S_IWRITE)
            remove(name)

    whole = f"\\\\?\\{path.absolute()}"  # long paths need this prefix
    if sys.version_info >= (3, 12):
        shutil.rmtree(whole, onexc=unprotect)
    else:
        shutil.rmtree(whole, onerror=unprotect)
