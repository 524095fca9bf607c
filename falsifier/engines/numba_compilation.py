"""Numba's decorator, with an on-disk cache that works even if the package folder is read-only."""

from collections.abc import Callable
from typing import Any, TypeVar

from falsifier.core.files import own_temporary_folder
from falsifier.errors import SpecError

_Function = TypeVar("_Function", bound=Callable[..., object])


def compiled(function: _Function, *, forceinline: bool = False, fastmath: bool = False) -> _Function:
    """Compile a function at its first call and cache the machine code for later processes.

    Numba writes the cache next to the source or to the user's cache folder. If both are read-only (for
    example in a container without a home directory), a temporary folder is used; if that belongs to another
    user, nothing is cached. A damaged cache is written again.

    Args:
        function: the function to compile.
        forceinline: whether to inline its machine code at every call.
        fastmath: whether sums may be reordered and non-finite numbers ignored.

    Raises:
        SpecError: if numba must not compile.
    """
    import numba

    from falsifier.engines.checked_cache import check_cache

    if numba.config.DISABLE_JIT:
        raise SpecError("NUMBA_DISABLE_JIT is set, but falsifier must compile; unset it")
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    options |= {"forceinline": forceinline, "fastmath": fastmath}

    try:
        result: _Function = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # numba found no writable cache folder
        folder = own_temporary_folder("falsifier-numba")
        if folder is not None:
            numba.config.CACHE_DIR = str(folder)
        result = numba.njit(cache=folder is not None, **options)(function)
    check_cache(result)
    return result
