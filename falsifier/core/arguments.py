"""Checks of values that users write in Python; what is wrong is a SpecError that names the argument."""

import reprlib
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from math import isfinite
from numbers import Real
from operator import index
from os import PathLike, fspath
from pathlib import Path
from typing import Any, SupportsIndex, TypeVar

from falsifier.errors import SpecError

T = TypeVar("T")


def whole(name: str, given: object, *, least: int) -> int:
    """Return a whole number that a user gave, numpy's too, as an int."""
    with suppress(TypeError):  # of an array of numpy, which has an index only if it is one whole number
        if isinstance(given, SupportsIndex) and not isinstance(given, bool) and index(given) >= least:
            return index(given)
    raise SpecError(f"{name}: expected a whole number, at least {least}, got {given!r}")


def finite(name: str, given: object, expected: str = "a finite number") -> float:
    """Return a number that a user gave, numpy's too, as a float."""
    with suppress(OverflowError):  # of an int that no float can be
        if isinstance(given, Real) and not isinstance(given, bool) and isfinite(given):
            return float(given)
    raise SpecError(f"{name}: expected {expected}, got {reprlib.repr(given)}")


def positive(name: str, given: object) -> float:
    """Return a positive number that a user gave, such as a duration in s."""
    if (number := finite(name, given)) > 0:
        return number
    raise SpecError(f"{name}: expected a positive number, got {given!r}")


def instance(name: str, given: object, kind: Any, expected: str) -> None:
    """Check the type of a value that a user gave."""
    if not isinstance(given, kind):
        raise SpecError(f"{name}: expected {expected}, got {reprlib.repr(given)} ({type(given).__name__})")


def path_of(name: str, given: str | PathLike[str], expected: str = "a path") -> Path:
    """Return the path that a user gave."""
    instance(name, given, (str, PathLike), expected)
    if not given:
        raise SpecError(f"{name}: expected {expected}, got an empty text")
    return Path(utf_8(fspath(given)))


def utf_8(path: str) -> str:
    """Return a text with a path; SpecError if it cannot be one, or not in UTF-8, in which all is recorded."""
    if "\0" in path:
        raise SpecError(f"{path!r}: no file has the character NUL in its name; correct the path")
    try:
        path.encode()
    except UnicodeEncodeError:
        shown = path.encode("utf-8", "backslashreplace").decode().replace("\\udc", "\\x")
        read_as = sys.getfilesystemencoding()  # other than UTF-8 with PYTHONUTF8=0 in some locales
        cure = "rename the file or folder" if read_as == "utf-8" else "set PYTHONUTF8=1"
        raise SpecError(f"{shown}: the name is not valid {read_as.upper()}; {cure}") from None
    return path


def list_of(name: str, given: Iterable[T], kind: Any, expected: str) -> tuple[T, ...]:
    """Return what is in a list that a user gave, all of one kind."""
    found = tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else None
    if found is None or not all(isinstance(each, kind) for each in found):
        raise SpecError(f"{name}: expected a list of {expected}, got {reprlib.repr(given)}")
    return found


def texts(name: str, given: Iterable[str]) -> tuple[str, ...]:
    """Return the texts of a list that a user gave."""
    return list_of(name, given, str, "texts")


def one_of(name: str, given: object, allowed: Sequence[str]) -> None:
    """Check that a word is one of those allowed."""
    if given not in allowed:
        raise SpecError(f"{name}: expected {', '.join(allowed[:-1])} or {allowed[-1]}, got {given!r}")
