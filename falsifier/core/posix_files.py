"""Files without names, locks, and folders that are removed in any state, on Linux and macOS."""

import contextlib
import fcntl
import os
import pwd
import shutil
import subprocess
import sys
import tempfile
from io import FileIO
from pathlib import Path

from falsifier.errors import MachineError


def unnamed_file(*, may_be_sealed: bool = False) -> FileIO:
    """Open a file without a name, in memory if the system supports that.

    Args:
        may_be_sealed: whether anybody who has it, an FMU too, may forbid all others to resize or write it.
    """
    if sys.platform == "linux" and hasattr(os, "memfd_create"):
        sealing = os.MFD_ALLOW_SEALING if may_be_sealed else 0
        return FileIO(os.memfd_create("falsifier-fmu", os.MFD_CLOEXEC | sealing), "w+b")
    return tempfile.TemporaryFile(buffering=0)


def enlarge(file: FileIO, size: int) -> None:
    """Enlarge a file shared with FMU processes to so many bytes; OSError if no larger one may be or fits."""
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
    file = unnamed_file(may_be_sealed=True)
    enlarge(file, size)
    if sys.platform == "linux" and hasattr(os, "memfd_create"):
        fcntl.fcntl(file, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL)
    return file


def lock_file(path: Path, mode: int = 0o600) -> int | None:
    """Create and lock a file; the lock ends with the last process that has the returned descriptor open.

    Returns:
        The descriptor; None if the file is locked already.

    Raises:
        MachineError: if the file system has no locks, as Lustre has none unless it is mounted with them.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, mode)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        if isinstance(error, BlockingIOError):
            return None
        raise MachineError(
            f"{path} cannot be locked ({error.strerror}): choose a folder on a file system that has locks"
        ) from None
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
    with contextlib.suppress(OSError, RecursionError):
        shutil.rmtree(path)
    if path.is_dir() and not path.is_symlink():
        # Folders that lie thousands deep, or that nobody may read. In them, no links are followed.
        for program in (["chmod", "-R", "u+rwx"], ["rm", "-rf"]):
            with contextlib.suppress(OSError):
                subprocess.run([*program, str(path)], stderr=subprocess.DEVNULL, check=False)
