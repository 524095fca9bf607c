"""Numba's decorator with a cache that can be written wherever the package is installed."""

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., object])


def compiled(function: _Function, *, forceinline: bool = False) -> _Function:
    """Compile a function at its first call and keep the machine code for later processes.

    Numba keeps it beside the source or in the user's cache folder. Where it can write neither (a read-only
    container without a home) it goes to a folder for temporary files, and where that is not this user's own,
    nowhere.

    Args:
        function: to compile.
        forceinline: whether its machine code is copied to where it is called.
    """
    import numba

    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "forceinline": forceinline}

    try:
        result: _Function = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # no folder that can be written
        folder = _own_temporary_folder()
        if folder is not None:
            numba.config.CACHE_DIR = str(folder)
        result = numba.njit(cache=folder is not None, **options)(function)
    return result


def _own_temporary_folder() -> Path | None:
    """Folder for temporary files that nobody else can write to: machine code is loaded from it."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"falsifier-numba-{user}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.stat()
    except OSError:
        return None
    is_own = not hasattr(os, "getuid") or (found.st_uid == user and found.st_mode & 0o022 == 0)
    return folder if is_own and os.access(folder, os.W_OK) else None
