"""The files of an SSP package (``.ssp``, a zip archive) or beside a system description (``.ssd``)."""

import atexit
import os
import shutil
from collections.abc import Callable
from functools import lru_cache
from hashlib import sha256
from pathlib import Path, PurePosixPath
from typing import TypeVar
from urllib.parse import unquote, urlsplit

from falsifier.errors import ModelError, SpecError
from falsifier.fmu.description import UNREADABLE, entry_names, file_hash, open_archive, read_entry
from falsifier.fmu.process import WorkFolder

T = TypeVar("T")
DESCRIPTION = "SystemStructure.ssd"
SUFFIXES = (".ssp", ".ssd")
_MAX_TEXT_BYTES = 64 << 20


class Package:
    """Read access to the files to which a system description refers.

    Args:
        path: path of the ``.ssp`` or ``.ssd`` file.
        shown: its name in messages.
        description: name of the system description within an archive.

    Attributes:
        key: tells this description from all others.

    Raises:
        SpecError: if the file cannot be read, or the archive is rejected.
    """

    def __init__(self, path: Path, shown: str, description: str = DESCRIPTION) -> None:
        self._path, self.shown = path, shown
        self._is_archive = path.suffix == ".ssp"
        self.description = description if self._is_archive else path.name
        self._base = PurePosixPath(description).parent
        self.key = f"{path.resolve()} {self.description}"
        if not path.is_file():
            raise SpecError(f"{shown}: no such file; give the path of an .ssp or .ssd file")
        self._names: frozenset[str] = frozenset()
        if self._is_archive:
            self._names = frozenset(_checked(lambda: entry_names(path)))
            if self.description not in self._names:
                raise SpecError(
                    f"{shown}: the package contains no {self.description}; export the system again"
                )

    def structure(self) -> bytes:
        """Return the text of the system description."""
        return self.text(PurePosixPath(self.description).name)

    def nested(self, source: str) -> "Package":
        """Return the package of another system description, in this archive or beside this one.

        Raises:
            SpecError: if it is missing, outside the package, or cannot be read.
        """
        shown = f"{self.shown}: {source}"
        if self._is_archive and source.endswith(".ssd"):
            return Package(self._path, shown, self._name(source))
        return Package(self.file(source), shown)

    def text(self, source: str) -> bytes:
        """Return the content of a text file.

        Raises:
            SpecError: if it is missing, outside the package, or too large.
        """
        name = self._name(source)
        if self._is_archive:
            return _checked(lambda: read_entry(self._path, name))
        path = self._path.parent / name
        if path.stat().st_size > _MAX_TEXT_BYTES:
            raise SpecError(f"{self.shown}: {name} has more than {_MAX_TEXT_BYTES >> 20} MiB")
        return path.read_bytes()

    def file(self, source: str) -> Path:
        """Return the path of a binary file, which is extracted from an archive.

        Raises:
            SpecError: if it is missing or outside the package, or the archive is damaged.
        """
        name = self._name(source)
        return _extracted(self._path, name) if self._is_archive else self._path.parent / name

    def _name(self, source: str) -> str:
        """Return the path of a resource within the package."""
        try:
            parts = urlsplit(source)
        except ValueError:
            raise SpecError(f"{self.shown}: {source!r} is not a path; name a file in the package") from None
        path = PurePosixPath(unquote(parts.path))
        if parts.scheme or parts.netloc or path.is_absolute() or ".." in path.parts:
            raise SpecError(
                f"{self.shown}: {source!r} is not inside the package; put the file there and name it "
                f"relative to {self.description}"
            )
        name = (self._base / path).as_posix() if self._is_archive else path.as_posix()
        found = name in self._names if self._is_archive else _is_file(self._path.parent / name)
        if not found:
            raise SpecError(f"{self.shown}: the resource {source!r} is missing; export the package again")
        return name


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # the name is too long
        return False


def _checked(read: Callable[[], T]) -> T:
    """Call a function of py; what is wrong with a package is wrong usage."""
    try:
        return read()
    except ModelError as error:
        raise SpecError(str(error)) from None


@lru_cache(maxsize=256)
def _extracted(path: Path, name: str) -> Path:
    """Extract one file of a package to a folder of this process, which is removed when the process ends."""
    key = sha256(f"{_checked(lambda: file_hash(path))} {name}".encode()).hexdigest()[:16]
    target = _folder() / key / PurePosixPath(name).name
    if target.is_file():
        return target
    target.parent.mkdir(parents=True, exist_ok=True)
    partial = target.with_name(f"{target.name}.partial")
    try:
        with open_archive(path) as package, package.open(name) as packed, partial.open("wb") as out:
            shutil.copyfileobj(packed, out)
    except (ModelError, *UNREADABLE) as error:
        raise SpecError(f"{path}: cannot unpack {name} ({error})") from error
    partial.rename(target)
    return target


@lru_cache(maxsize=1)
def _folder() -> Path:
    folder, owner = WorkFolder(), os.getpid()

    def remove() -> None:
        if os.getpid() == owner:
            folder.remove()

    atexit.register(remove)
    return folder.path
