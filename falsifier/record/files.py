"""Files and folders of a run: sealed values, trajectories, locks, and what is set aside."""

import errno
import fcntl
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from itertools import count
from pathlib import Path
from stat import S_ISREG
from time import monotonic, sleep
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from falsifier.core.files import check_seal, checksum, seal, write_whole
from falsifier.core.literals import one_line, shell_word
from falsifier.core.posix_files import lock_file
from falsifier.core.trajectory import Trajectory
from falsifier.errors import JournalError, MonitorError, first_fault, in_section, warn_once, written

TRAJECTORIES = "trajectories"
# The file that makes a directory a campaign's, whose runs have directories of their own below it.
CAMPAIGN = "campaign.json"
# Names of files that are complete.
TRAJECTORY_NAMES = r"\d+-[0-9a-f]+\.npz"

# Time in s for which a lock is waited for in any case.
_MOMENT = 0.3

# Errors of the operating system that say that a path can never be a folder.
_NO_FOLDER = frozenset({errno.EEXIST, errno.ENOENT, errno.ENOTDIR, errno.ENAMETOOLONG, errno.ELOOP})

Content = TypeVar("Content", bound=BaseModel)


def write_sealed(path: Path, content: BaseModel) -> None:
    """Write a value, whose last field is ``sum``, with its checksum."""
    write_whole(path, seal(content.model_dump_json(indent=2, exclude={"sum"})))


def read_sealed(path: Path, kind: type[Content], *, what: str) -> Content:
    """Read a value of a ``what``; JournalError if there is no such file, or it is damaged or not valid."""
    try:
        content = path.read_bytes()
        check_seal(content)
        with in_section(str(path)):  # of values that are checked when they are made
            return kind.model_validate_json(content)
    except (FileNotFoundError, NotADirectoryError):
        if not path.parent.exists():
            raise JournalError(f"{path.parent}: no such directory; expected that of a {what}") from None
        raise JournalError(f"{path.parent}: not a {what} directory: it contains no {path.name}") from None
    except ValidationError as error:
        raise JournalError(": ".join((str(path), *first_fault(error)))) from None
    except (ValueError, OSError) as error:
        campaign = path.absolute().parent.parent.parent
        remedy = f"this {what} cannot be continued: start a new one"
        if what == "run" and (campaign / CAMPAIGN).exists():
            remedy = f"to let the campaign repeat this run: falsifier tools repair {shell_word(campaign)}"
        raise JournalError(f"{path} is damaged: {one_line(str(error))}; {remedy}") from error


@contextmanager
def locked(path: Path, *, busy: str, patience: float = 0.0) -> Iterator[None]:
    """Hold a lock file; that of a killed process is released by the system.

    Another process is waited for, ``patience`` s at most, or a moment, as is_locked() takes one; ``busy`` is
    what to say if it still holds the file.

    Raises:
        JournalError: if another process still holds it after that time.
        MachineError: if the file system has no locks.
    """
    # The package filelock would fall back to files without locks, which a second process removes.
    until = monotonic() + max(patience, _MOMENT)
    while (held := lock_file(path, 0o666)) is None:
        if monotonic() > until:
            raise JournalError(busy)
        sleep(0.05)
    try:
        yield
    finally:
        os.close(held)


def is_locked(path: Path) -> bool:
    """Whether a process holds a lock file that exists; also where it may be read only."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:  # else nobody writes there: it is gone, or its file system has no locks
        return isinstance(error, BlockingIOError | PermissionError)
    return False


def save_trajectory(directory: Path, index: int, trajectory: Trajectory) -> str:
    """Write a trajectory to a run directory and force it to disk; return its name for the record.

    Raises:
        OSError: if it cannot be written, or the folder of trajectories is gone.
    """
    (directory / TRAJECTORIES).stat()  # else a run directory that was moved would be made again
    content = trajectory.content()
    name = f"{TRAJECTORIES}/{index}-{checksum(content)}.npz"
    write_whole(directory / name, content)
    return name


def recorded_trajectory(directory: Path, name: str | None) -> Trajectory | None:
    """Load the trajectory of a record; None if it is not kept, or is damaged, of which a warning tells."""
    if name is None:
        return None
    path = directory / name
    try:
        if not is_own_file(path):
            raise OSError("it is no file of the run")
        content = path.read_bytes()
        if is_intact(path, content):
            return Trajectory.load(BytesIO(content))
        _tell_lost(path, "its checksum does not match")
    except MonitorError as error:  # which somebody has written on purpose
        _tell_lost(path, str(error))
    except OSError as error:
        # Where only the best one is kept, it is the only file, and later than those that it has replaced.
        left = [_index(p) for p in path.parent.glob("*.npz") if re.fullmatch(TRAJECTORY_NAMES, p.name)]
        if not (isinstance(error, FileNotFoundError) and len(left) == 1 and left[0] > _index(path)):
            _tell_lost(path, error.strerror or str(error))
    return None


def _index(trajectory: Path) -> int:
    return int(trajectory.name.partition("-")[0])


def _tell_lost(path: Path, why: str) -> None:
    warn_once(f"{path} is damaged: {why}. It is left out, or simulated again where it is needed.")


def is_own_file(path: Path) -> bool:
    """Whether a path is a file and no link, device or pipe, which may lead anywhere or never end."""
    return S_ISREG(path.lstat().st_mode)


def is_intact(path: Path, content: bytes) -> bool:
    """Whether the content of a trajectory's file matches the checksum in its name."""
    return path.stem.rpartition("-")[2] == checksum(content)


@contextmanager
def can_be_a_folder(directory: Path) -> Iterator[None]:
    """Name a path that can never be a folder, in a JournalError instead of the operating system's error."""
    try:
        yield
    except OSError as error:
        if error.errno not in _NO_FOLDER:
            raise
        directory.absolute()  # OSError if it is relative and the current folder was deleted
        raise JournalError(
            f"{directory}: no folder can be made here ({error.strerror}); choose another directory"
        ) from None


def make_folder(directory: Path) -> None:
    """Make a folder, and those above it, where they are missing; JournalError if it can never be one."""
    with can_be_a_folder(directory):
        directory.mkdir(parents=True, exist_ok=True)


def check_unused(directory: Path) -> None:
    """Check that a folder that is to be written has no content; a killed process left empty or partial files.

    Raises:
        JournalError: if it has any, which users may have changed, or cannot be a folder.
    """
    with can_be_a_folder(directory):
        for path in directory.iterdir() if directory.exists() else ():
            full = next(path.iterdir(), None) if path.is_dir() else path.lstat().st_size
            if full and not path.match("*.json.*.partial"):  # of write_whole
                other = f"choose another {written('--out', 'directory')}, new or empty, or delete them"
                raise JournalError(f"{directory} has files, which are kept: {other}")


def set_aside(path: Path) -> Path:
    """Rename a damaged file or folder, so that it is kept but no longer read; return its new path."""
    return path.rename(free_name(path))


def free_name(path: Path) -> Path:
    """Return a name beside a damaged file that nothing has yet."""
    names = (path.with_name(f"{path.name}.damaged-{i}") for i in count(1))
    return next(name for name in names if not name.exists())
