"""The files of an SSP package (``.ssp``, a zip archive) or beside a system description (``.ssd``).

With the values that parameter bindings take from sets and files, renamed and transformed by mappings.
"""

import atexit
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import TypeVar
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element

from falsifier.core.files import absent
from falsifier.core.literals import number_in
from falsifier.errors import ModelError, SpecError, did_you_mean, in_section
from falsifier.fmu.description.archive import extract, file_hash
from falsifier.fmu.description.variables import is_true
from falsifier.fmu.description.xml import read_xml
from falsifier.fmu.process.workplace import WorkFolder

T = TypeVar("T")
SUFFIXES = (".ssp", ".ssd")
_DESCRIPTION = "SystemStructure.ssd"
_MAX_TEXT_BYTES = 64 << 20
_NAMESPACE = "{http://ssp-standard.org/SSP"
_VALUE_TAGS = ("Boolean", "String", "Enumeration", "Real", "Integer", "Float64", "Float32", *(
    f"{u}Int{b}" for u in ("", "U") for b in (8, 16, 32, 64)
))  # fmt: skip
_MAPPINGS = tuple(f"{kind}MappingTransformation" for kind in ("Boolean", "Integer", "Enumeration"))


class Package:
    """Read access to the files to which a system description refers.

    Args:
        path: path of the ``.ssp`` or ``.ssd`` file.
        shown: its name in messages.

    Raises:
        SpecError: if the file cannot be read, or the archive is rejected.
    """

    def __init__(self, path: Path, shown: str) -> None:
        self.shown = shown
        if not path.is_file():
            raise SpecError(f"{absent(path)}; give the path of an .ssp or .ssd file")
        if path.suffix.lower() == ".ssp":
            try:
                path = _unpacked(path, file_hash(path)) / _DESCRIPTION
            except ModelError as error:  # what is wrong with a package is wrong usage
                raise SpecError(str(error)) from None
            if not path.is_file():
                raise SpecError(f"{shown}: the package contains no {_DESCRIPTION}; export the system again")
        self.description = path  # of the system description

    def file(self, source: str) -> Path:
        """Return the path of a file; SpecError if it is missing or outside the package."""
        try:
            parts = urlsplit(source)
        except ValueError:
            raise SpecError(f"{source!r} is not a path; name a file in the package") from None
        path = PurePosixPath(unquote(parts.path))
        if parts.scheme or parts.netloc or path.is_absolute() or ".." in path.parts:
            raise SpecError(
                f"{source!r} is not inside the package; put the file there and name it relative to "
                f"{self.description.name}"
            )
        found = self.description.parent / path
        try:
            if found.is_file():
                return found
        except (OSError, ValueError):  # the name is too long, or no name
            pass
        raise SpecError(f"the resource {source!r} is missing; export the package again")


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


@contextmanager
def opened(path: Path, shown: str, expected: str) -> Iterator[Element]:
    """Give the root element of a file, for as long as it is read.

    Raises:
        SpecError: if it has not the expected name; also names the file in what is then found wrong.
    """
    with in_section(shown):
        if path.stat().st_size > _MAX_TEXT_BYTES:
            raise SpecError(f"it has more than {_MAX_TEXT_BYTES >> 20} MiB; split it")
        root = read_xml(path.read_bytes(), "the file", SpecError)
        if not root.tag.startswith(_NAMESPACE) or tag(root) != expected:
            raise SpecError(f"expected the SSP element {expected}, got {root.tag}")
        yield root


@contextmanager
def within(place: str) -> Iterator[None]:
    """Name the element of which an error raised within speaks, if it names no other file."""
    try:
        yield
    except SpecError as error:
        if error.file is not None:
            raise
        raise SpecError(f"{place}: {error}") from None


def tag(element: Element) -> str:
    """Return the name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def attribute(element: Element, name: str) -> str:
    """Return an attribute; SpecError naming the element if it is missing."""
    if (found := element.get(name)) is None:
        stated = "".join(f' {key}="{value}"' for key, value in element.attrib.items())
        raise SpecError(f"<{tag(element)}{stated}>: the attribute {name!r} is missing")
    return found


def type_and_unit(element: Element) -> tuple[str, str, Element]:
    """Return type and unit of a value or connector, empty without one, and the element that states them."""
    typed = next((child for child in element if tag(child) in _VALUE_TAGS), None)
    if typed is None:
        return "", "", element
    unit = typed.get("unit", "")
    return tag(typed), "" if unit == "1" else unit, typed


def number(name: str, text: str) -> float:
    """Return the finite number that an attribute states; raise SpecError for others."""
    if (found := number_in(text)) is None:
        raise SpecError(f"{name}: {text!r} is not a finite number; correct it")
    return found


@dataclass(frozen=True, slots=True)
class Transformation:
    """A linear transformation ``factor * value + offset``, and whether units are not converted before it."""

    factor: float = 1.0
    offset: float = 0.0
    suppress: bool = False


def transformation(element: Element) -> Transformation:
    """Return the transformation of a connection, or of an entry of a mapping."""
    for child in element:
        if tag(child) in _MAPPINGS:
            raise SpecError(f"the element {tag(child)} is not supported; map the values inside a component")
    stated = {k: v for each in element.findall("{*}LinearTransformation") for k, v in each.attrib.items()}
    factor, offset = number("factor", stated.get("factor", "1")), number("offset", stated.get("offset", "0"))
    if factor == 0.0:
        raise SpecError("a LinearTransformation has the factor 0, which passes nothing on; set a parameter")
    return Transformation(factor, offset, is_true(element.get("suppressUnitConversion")))


@dataclass(frozen=True, slots=True)
class Given:
    """A value that a package gives, before the variable that it is for is known."""

    name: str  # its name in the parameter set
    value: float | str  # a number, or the text of a string or of an enumeration's item
    is_item: bool  # whether it is the latter
    unit: str  # its unit
    transformation: Transformation = Transformation()  # transformation by a mapping


def bound_values(element: Element, package: Package) -> dict[str, Given]:
    """Return an element's bindings, named from it; later ones win. SpecError if a file is absent or wrong."""
    found: dict[str, Given] = {}
    for binding in element.findall("{*}ParameterBindings/{*}ParameterBinding"):
        mapping = binding.find("{*}ParameterMapping")
        for each in (binding, mapping):
            if each is not None and each.get("sourceBase", "SSD") != "SSD":
                raise SpecError("parameters inside an FMU (sourceBase) are not supported; put them beside it")
        values = _entries(binding, package, "ParameterSet", ".//{*}Parameters/{*}Parameter", _value)
        named = {binding.get("prefix", "") + value.name: value for value in values}
        if mapping is None:
            found |= named
            continue
        # With a mapping, only what it names.
        for source, target, change in _entries(
            mapping, package, "ParameterMapping", ".//{*}MappingEntry", _mapped
        ):
            if source not in named:
                near = did_you_mean(source, named)
                raise SpecError(f"a mapping names the unknown parameter {source!r}; {near}")
            found[target] = replace(named[source], transformation=change)
    return found


def _entries(
    stated: Element, package: Package, expected: str, path: str, read: Callable[[Element], T]
) -> list[T]:
    """Return what an element contains, or the file that it names."""
    if not (source := stated.get("source")):
        return [read(each) for each in stated.findall(path)]
    with opened(package.file(source), f"{package.shown}: {source}", expected) as root:
        return [read(each) for each in root.findall(path)]


def _value(parameter: Element) -> Given:
    name = attribute(parameter, "name")
    kind, unit, typed = type_and_unit(parameter)
    with within(f"the parameter {name}"):
        if not kind:
            raise SpecError(f"it has no value of a known type; state one as {', '.join(_VALUE_TAGS[:5])}")
        value: float | str = attribute(typed, "value")
        if kind == "Boolean" and value not in ("true", "false", "0", "1"):
            raise SpecError(f"{value!r}: expected true or false")
        if kind not in ("Enumeration", "String"):
            value = float(is_true(str(value))) if kind == "Boolean" else number("value", str(value))
    return Given(name, value, kind == "Enumeration", unit)


def _mapped(entry: Element) -> tuple[str, str, Transformation]:
    source, target = attribute(entry, "source"), attribute(entry, "target")
    with within(f"the mapping of {source} to {target}"):
        return source, target, transformation(entry)
