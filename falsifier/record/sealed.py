"""Files written once that end with a checksum: the manifest of a run, and what a campaign was asked for."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from filelock import FileLock, Timeout
from pydantic import BaseModel, ValidationError

from falsifier.core.files import check_seal, seal, write_whole
from falsifier.core.literals import one_line
from falsifier.errors import JournalError, rejected

Content = TypeVar("Content", bound=BaseModel)


def write_sealed(path: Path, content: BaseModel) -> None:
    """Write a value, whose last field is ``sum``, with its checksum."""
    write_whole(path, seal(content.model_dump_json(indent=2, exclude={"sum"})))


def read_sealed(path: Path, kind: type[Content], *, what: str) -> Content:
    """Read a value.

    Args:
        path: the file.
        kind: its type.
        what: what it belongs to, such as ``run``.

    Raises:
        JournalError: if there is no such file, or it is damaged or not valid.
    """
    try:
        content = path.read_bytes()
        check_seal(content)
        return kind.model_validate_json(content)
    except (FileNotFoundError, NotADirectoryError):
        if not path.parent.exists():
            raise JournalError(f"{path.parent}: no such directory; expected that of a {what}") from None
        raise JournalError(f"{path.parent}: not a {what} directory: it contains no {path.name}") from None
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise JournalError(f"{path}: {key}: {rejected(first['msg'], first['input'])}") from None
    except (ValueError, OSError) as error:
        raise JournalError(
            f"{path} is damaged: {one_line(str(error))}; this {what} cannot be continued: start a new one"
        ) from None


@contextmanager
def locked(path: Path, *, busy: str, patience: float = 0.0) -> Iterator[None]:
    """Hold a lock file; that of a killed process is released by the system.

    Args:
        path: the lock file.
        busy: what to say if another process holds it.
        patience: time in s to wait for that process.

    Raises:
        JournalError: if another process still holds it after that time.
    """
    lock = FileLock(path)
    try:
        lock.acquire(timeout=patience)
    except Timeout:
        raise JournalError(busy) from None
    try:
        yield
    finally:
        lock.release()
