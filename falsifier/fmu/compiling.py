"""Compiles with numba, and notices that; later processes load the result from the cache."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

# What numba calls when an array that owns its memory is no longer needed, and the name that it gets in object
# files: loops own no arrays, and what numba's name stands for in this process must stay.
_NUMBAS_NAME, FREES_ARRAYS = "NRT_MemInfo_call_dtor", "falsifier_frees_arrays"


@contextmanager
def on_compilation(tell: Callable[[], None]) -> Iterator[None]:
    """Call ``tell`` once, when numba starts to compile the first function that is not in its cache."""
    from numba.core import event

    told = False

    class Watcher(event.Listener):  # type: ignore[misc]
        def on_start(self, _event: object) -> None:
            nonlocal told
            if not told:
                told = True
                tell()

        def on_end(self, _event: object) -> None:
            pass

    with event.install_listener("numba:compile", Watcher()):
        yield


def compiled_object(function: Callable[[int, int], int], machine: Any) -> tuple[str, tuple[str, ...], bytes]:
    """Compile a function of two integers to an object file.

    Args:
        function: what to compile.
        machine: LLVM's description of the machine.

    Returns:
        The name of its machine code, the names of the functions that it calls, and the object file.
    """
    import numba
    from llvmlite import binding

    signature = (numba.types.intp, numba.types.intp)
    options: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    compiled: Any = numba.njit(nogil=True, error_model="numpy", **options)(function)
    compiled.compile(signature)
    text = compiled.inspect_llvm(signature).replace(_NUMBAS_NAME, FREES_ARRAYS)
    module = binding.parse_assembly(text)
    needed = [f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")]
    symbol = compiled.overloads[signature].fndesc.llvm_func_name
    return symbol, tuple(needed), machine.emit_object(module)
