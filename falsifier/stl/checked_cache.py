"""Numba's cache files with a checksum: damaged machine code is compiled again instead of run."""

import pickle
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba.core.caching import IndexDataCacheFile

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


def check_cache(function: Any) -> None:
    """Let a compiled function's cache notice damage."""
    file = getattr(getattr(function, "_cache", None), "_cache_file", None)
    if type(file) is IndexDataCacheFile:
        file.__class__ = _CheckedFile


def _check(content: bytes) -> None:
    if sha256(content[:-_SUM_LENGTH]).digest() != content[-_SUM_LENGTH:]:
        raise OSError("damaged")  # which numba takes for a file that is gone
