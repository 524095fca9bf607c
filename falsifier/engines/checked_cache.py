"""Numba's cache files, checked: machine code that is damaged or older than its sources is compiled again."""

import pickle
import re
import sys
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.runtime import rtsys

_SUM_LENGTH = sha256().digest_size


class _CheckedFile(IndexDataCacheFile):  # type: ignore[misc]
    """Index and data of one function's cache; what cannot be read is as if it were not there."""

    def save(self, key: Any, data: Any) -> None:
        with suppress(OSError):  # a full disk: compiled again by the next process
            super().save(key, data)

    def _dump(self, content: Any) -> bytes:
        dumped: bytes = super()._dump(content)
        return dumped + sha256(dumped).digest()

    def _load_index(self) -> dict[Any, str]:
        try:
            with Path(self._index_path).open("rb") as file:
                pickle.load(file)  # numba's version
                _check(file.read())
            index: dict[Any, str] = super()._load_index()
        except Exception:  # unpickling damaged bytes may raise anything
            return {}
        return index

    def _load_data(self, name: str) -> Any:
        _check(Path(self._data_path(name)).read_bytes())
        return super()._load_data(name)


class _QuickCache(FunctionCache):  # type: ignore[misc]
    """Cache of one function, which loads machine code without what is needed only to compile.

    Before it looks into the cache, numba imports its implementations of Python's and numpy's functions. That
    takes most of the time that a process needs to its first result. The compiler does it in any case.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            found = self._load_overload(sig, target_context)
        return super().load_overload(sig, target_context) if found is None else found


_IMPORTS = re.compile(r"^from ([\w.]+) import", re.MULTILINE)
# Sources of the compiled functions of each module, with those of the compiled functions that it imports.
_SOURCES: dict[str, frozenset[str]] = {}


def check_cache(function: Any) -> None:
    """Let a compiled function's cache notice damage, and changes in what the function calls.

    Numba looks at the function's own file, but the machine code contains functions and constants of others.
    """
    cache: Any = getattr(function, "_cache", None)
    file: Any = getattr(cache, "_cache_file", None)
    if type(cache) is FunctionCache:
        cache.__class__ = _QuickCache
    sources = _sources(function.py_func)
    if type(file) is IndexDataCacheFile:
        file.__class__ = _CheckedFile
        file._source_stamp = (file._source_stamp, *sorted(_stamp(Path(source)) for source in sources))


def _sources(function: Any) -> frozenset[str]:
    """Return the files of a function's module and of what it imports: compiled functions, and constants.

    Constants are those of modules of the same package.
    """
    used = {getattr(value, "__module__", None) for value in function.__globals__.values()}
    imported = (_SOURCES[module] for module in used - {function.__module__} if module in _SOURCES)
    file = function.__code__.co_filename
    constants = _constants(file, function.__module__.partition(".")[0])
    _SOURCES[function.__module__] = frozenset({file, *constants}).union(*imported)
    return _SOURCES[function.__module__]


@cache
def _constants(file: str, package: str) -> tuple[str, ...]:
    """Return the files of the modules of a package from which a file imports names."""
    with suppress(OSError):  # code that was typed in has no file
        text = Path(file).read_text(encoding="utf-8")
        modules = (sys.modules.get(name) for name in _IMPORTS.findall(text) if name.startswith(f"{package}."))
        return tuple(found for m in modules if (found := getattr(m, "__file__", None)))
    return ()


def _stamp(source: Path) -> tuple[str, float, int]:
    found = source.stat()
    return source.name, found.st_mtime, found.st_size


def _check(content: bytes) -> None:
    if sha256(content[:-_SUM_LENGTH]).digest() != content[-_SUM_LENGTH:]:
        raise OSError("damaged")  # which numba takes for a file that is gone
