"""Numba's decorator with a cache that can be written wherever the package is installed."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

_Function = TypeVar("_Function", bound=Callable[..., object])


def compiled(function: _Function) -> _Function:
    """Compile a function at its first call and keep the machine code for later processes.

    Numba keeps it beside the source or in the user's cache folder; where it can write neither (a read-only
    container without a home), in the folder for temporary files.
    """
    import numba

    decorate = numba.njit(cache=True, error_model="numpy")
    try:
        result: _Function = decorate(function)
    except RuntimeError:
        numba.config.CACHE_DIR = str(Path(tempfile.gettempdir()) / "falsifier-numba-cache")
        result = decorate(function)
    return result
