"""The files of an SSP package (``.ssp``, a zip archive) or beside a system description (``.ssd``)."""

import atexit
import os
from functools import lru_cache
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, urlsplit

from falsifier.errors import ModelError, SpecError
from falsifier.fmu.description import extract, file_hash
from falsifier.fmu.process import WorkFolder

SUFFIXES = (".ssp", ".ssd")
_DESCRIPTION = "SystemStructure.ssd"
_MAX_TEXT_BYTES = 64 << 20


class Package:
    """Read access to the files to which a system description refers.

    Args:
        path: path of the ``.ssp`` or ``.ssd`` file.
        shown: its name in messages.

    Attributes:
        description: file name of the system description.
        key: tells this description from all others.

    Raises:
        SpecError: if the file cannot be read, or the archive is rejected.
    """

    def __init__(self, path: Path, shown: str) -> None:
        self.shown = shown
        if not path.is_file():
            raise SpecError(f"{shown}: no such file; give the path of an .ssp or .ssd file")
        if path.suffix == ".ssp":
            try:
                path = _unpacked(path, file_hash(path)) / _DESCRIPTION
            except ModelError as error:  # what is wrong with a package is wrong usage
                raise SpecError(str(error)) from None
            if not path.is_file():
                raise SpecError(f"{shown}: the package contains no {_DESCRIPTION}; export the system again")
        self._path = path
        self.description = path.name
        self.key = str(path.resolve())

    def structure(self) -> bytes:
        """Return the text of the system description."""
        return self._read(self._path)

    def nested(self, source: str) -> "Package":
        """Return the package of another system description, in this package or beside this one.

        Raises:
            SpecError: if it is missing, outside the package, or cannot be read.
        """
        return Package(self.file(source), f"{self.shown}: {source}")

    def text(self, source: str) -> bytes:
        """Return the content of a text file.

        Raises:
            SpecError: if it is missing, outside the package, or too large.
        """
        return self._read(self.file(source))

    def file(self, source: str) -> Path:
        """Return the path of a file.

        Raises:
            SpecError: if it is missing or outside the package.
        """
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
        found = self._path.parent / path
        try:
            if found.is_file():
                return found
        except (OSError, ValueError):  # the name is too long, or no name
            pass
        raise SpecError(f"{self.shown}: the resource {source!r} is missing; export the package again")

    def _read(self, path: Path) -> bytes:
        if path.stat().st_size > _MAX_TEXT_BYTES:
            raise SpecError(f"{self.shown}: {path.name} has more than {_MAX_TEXT_BYTES >> 20} MiB")
        return path.read_bytes()


@lru_cache(maxsize=64)
def _unpacked(path: Path, sha256: str) -> Path:
    """Unpack a package to a folder of this process, which is removed when the process ends."""
    target = _folder() / sha256[:16]
    if not target.is_dir():
        partial = target.with_suffix(".partial")
        extract(path, partial)
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
