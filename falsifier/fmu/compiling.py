"""Compiles with numba, and says so if that takes long; later processes load the result from the cache."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

_LONG_SECONDS = 1.0
# What numba calls when an array that owns its memory is no longer needed, and the name that it gets in object
# files: loops own no arrays, and what numba's name stands for in this process must stay.
_NUMBAS_NAME, FREES_ARRAYS = "NRT_MemInfo_call_dtor", "falsifier_frees_arrays"


@contextmanager
def on_long_compilation(tell: Callable[[], None], after: float = _LONG_SECONDS) -> Iterator[None]:
    """Call ``tell`` once if numba is still compiling ``after`` seconds after its first compilation started.

    Loading from numba's cache is not a compilation. Functions are compiled nested and in sequence; the clock
    is checked at the start and the end of each.
    """
    from numba.core import event

    started: float | None = None
    told = False

    def check_clock() -> None:
        nonlocal started, told
        now = time.perf_counter()
        started = now if started is None else started
        if not told and now - started > after:
            told = True
            tell()

    class Watcher(event.Listener):  # type: ignore[misc]
        def on_start(self, _event: object) -> None:
            check_clock()

        def on_end(self, _event: object) -> None:
            check_clock()

    with event.install_listener("numba:compile", Watcher()):
        yield


def compiled_object(
    function: Callable[[int, int], int], machine: Any, tell: Callable[[], None]
) -> tuple[str, tuple[str, ...], bytes]:
    """Compile a function of two integers to an object file.

    Args:
        function: what to compile.
        machine: LLVM's description of the machine.
        tell: called if it takes long.

    Returns:
        The name of its machine code, the names of the functions that it calls, and the object file.
    """
    import numba
    from llvmlite import binding

    signature = (numba.types.intp, numba.types.intp)
    options: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    compiled: Any = numba.njit(nogil=True, error_model="numpy", **options)(function)
    with on_long_compilation(tell):
        compiled.compile(signature)
    text = compiled.inspect_llvm(signature).replace(_NUMBAS_NAME, FREES_ARRAYS)
    module = binding.parse_assembly(text)
    needed = [f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")]
    symbol = compiled.overloads[signature].fndesc.llvm_func_name
    return symbol, tuple(needed), machine.emit_object(module)
