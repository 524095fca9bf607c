"""The files of an SSP package (``.ssp``, a zip archive) or beside a system description (``.ssd``).

With the values that parameter bindings take from sets and files, renamed and transformed by mappings.
"""

import atexit
import os
from collections.abc import Mapping as Names
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, urlsplit

from falsifier.core.model import Variable
from falsifier.errors import ModelError, SpecError, did_you_mean
from falsifier.fmu.description.archive import extract, file_hash
from falsifier.fmu.description.structure import Unit, conversion
from falsifier.fmu.process.workplace import WorkFolder
from falsifier.fmu.ssp.markup import Binding, Transformation, Value, parse_mappings, parse_values

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


@dataclass(frozen=True, slots=True)
class Given:
    """A value that a package gives, before the variable that it is for is known.

    Attributes:
        value: the value in the parameter set.
        transformation: transformation by a mapping.
        units: units that the package defines.
    """

    value: Value
    transformation: Transformation
    units: Names[str, Unit]

    def number(self, variable: Variable, shown: str) -> float | str:
        """Return the value for a variable, in its unit.

        Raises:
            SpecError: if type or unit do not fit.
        """
        value = self.value.value
        if isinstance(value, str) and not self.value.is_item:
            if variable.kind != "string":
                raise SpecError(
                    f"{shown}: {value!r} is a text, but {variable.name!r} is of type {variable.kind}"
                )
            return value
        if isinstance(value, str):
            if value not in variable.literals:
                near = did_you_mean(value, variable.literals)
                raise SpecError(f"{shown}: {variable.name!r} has no item {value!r}; {near}")
            return float(variable.literals[value])
        if variable.kind == "string":
            raise SpecError(f"{shown}: {value:g} is a number, but {variable.name!r} is a text")
        if not self.transformation.suppress:
            found = conversion(self.value.unit, variable.unit, (self.units, self.units))
            if found is None:
                raise SpecError(
                    f"{shown}: the parameter {self.value.name} is in {self.value.unit}, {variable.name!r} in "
                    f"{variable.unit}, and the package defines no conversion; state the variable's unit"
                )
            value = found[0] * value + found[1]
        return self.transformation.factor * value + self.transformation.offset


def bound_values(bindings: Sequence[Binding], package: Package, units: Names[str, Unit]) -> dict[str, Given]:
    """Return the values of an element's bindings by name, relative to the element; later ones win.

    Raises:
        SpecError: if a file is missing or wrong.
    """
    found: dict[str, Given] = {}
    for binding in bindings:
        values = binding.values
        if binding.source:
            values = parse_values(package.text(binding.source), f"{package.shown}: {binding.source}")
        named = {binding.prefix + value.name: value for value in values}
        mappings = binding.mappings
        if binding.mapping_source:
            mappings = parse_mappings(
                package.text(binding.mapping_source), f"{package.shown}: {binding.mapping_source}"
            )
        if mappings is None:
            found |= {name: Given(value, Transformation(), units) for name, value in named.items()}
            continue
        for entry in mappings:
            if entry.source not in named:
                near = did_you_mean(entry.source, named)
                raise SpecError(
                    f"{package.shown}: a mapping names the unknown parameter {entry.source!r}; {near}"
                )
            found[entry.target] = Given(named[entry.source], entry.transformation, units)
    return found
