"""Machine code of the compiled loops, in files that a worker loads without the compiler.

A worker uses two functions (``entries``). Importing numba and loading the functions from its cache took two
thirds of a worker's start; LLVM alone loads an object file in milliseconds. A file belongs to the sources, to
the versions of numba and LLVM and to the processor; one that is missing or damaged is compiled again.
"""

import ctypes
import json
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from falsifier.core.files import own_temporary_folder, write_whole
from falsifier.errors import ModelError
from falsifier.fmu.compiling import FREES_ARRAYS, compiled_object

# What the machine code of each entry is compiled from, in this folder.
_STEPPING = ("c_functions", "loop_numbers", "stepping")
SOURCES = {
    "co_simulation": _STEPPING,
    "model_exchange": (*_STEPPING, "continuous", "integrators", "solver", "solver_memory", "solver_row",
                       "solver_views"),
}  # fmt: skip

Entry = Callable[[int, "bytes | int"], int]

# How numba's functions are called: result, exception, arguments; the status is 0 if there was no exception.
_PROTOTYPE = ctypes.CFUNCTYPE(
    ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p
)


class _Results(threading.local):
    """Where each thread's calls leave their result: making new memory for each would take most of a call."""

    def __init__(self) -> None:
        self.memory = (ctypes.c_int64 * 2)()
        self.result = ctypes.addressof(self.memory)
        self.exception = self.result + 8


_RESULTS = _Results()
_LOCK = threading.Lock()
_LOADED: dict[str, Entry] = {}
_SUM_LENGTH = sha256().digest_size
# Machine code that has been loaded stays; so must what owns it.
_ENGINES: list[Any] = []


def _refuse(_memory: int) -> None:
    raise AssertionError("the loops own no arrays")


_NEVER_CALLED = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(_refuse)


@dataclass(frozen=True, slots=True)
class Code:
    """Machine code of one entry.

    Attributes:
        symbol: name of the function.
        needed: names of the functions that it calls.
        content: the object file.
    """

    symbol: str
    needed: tuple[str, ...]
    content: bytes


def co_simulation() -> Entry:
    """Return the entry to the loops of co-simulation; load it at the first call."""
    return _entry("co_simulation")


def model_exchange() -> Entry:
    """Return the entry to the solver; load it at the first call."""
    return _entry("model_exchange")


def load(name: str, tell: Callable[[], None] = lambda: None) -> None:
    """Load one entry; call ``tell`` before it is compiled, if it must be."""
    with _LOCK:
        if name not in _LOADED:
            code = kept(name)
            if code is None:
                tell()
                code = compile_entry(name)
                keep(name, code)
            _LOADED[name] = _callable(code)


def _entry(name: str) -> Entry:
    found = _LOADED.get(name)
    if found is None:
        load(name)
        found = _LOADED[name]
    return found


def kept(name: str) -> Code | None:
    """Return the machine code of an entry that fits the sources and this machine, if it is in a file."""
    for folder in _folders():
        with suppress(OSError, ValueError, KeyError, TypeError):
            content = (folder / _file_name(name)).read_bytes()
            body = content[_SUM_LENGTH:]
            if sha256(body).digest() != content[:_SUM_LENGTH]:
                continue
            head, _, code = body.partition(b"\n")
            said = json.loads(head)
            return Code(said["symbol"], tuple(said["needed"]), code)
    return None


def keep(name: str, code: Code) -> None:
    """Write machine code to the first folder that takes it; without one, each process compiles."""
    head = json.dumps({"symbol": code.symbol, "needed": code.needed}).encode()
    body = head + b"\n" + code.content
    file = _file_name(name)
    for folder in _folders():
        with suppress(OSError):
            write_whole(folder / file, sha256(body).digest() + body)
            _remove_outdated(folder, file)
            return


def _remove_outdated(folder: Path, file: str) -> None:
    """Remove older machine code; not what another process is writing, and Windows keeps what is in use."""
    for old in folder.glob(f"{file.rpartition('-')[0]}-*.o"):
        if old.name != file:
            with suppress(OSError):
                old.unlink()


def compile_entry(name: str) -> Code:
    """Compile an entry."""
    from falsifier.fmu import entries

    return Code(*compiled_object(getattr(entries, name), _machine()))


def _callable(code: Code) -> Entry:
    from llvmlite import binding

    _resolve(code.needed)
    module = binding.parse_assembly("")
    module.triple = binding.get_process_triple()
    engine = binding.create_mcjit_compiler(module, _machine())
    engine.add_object_file(binding.ObjectFileRef.from_data(code.content))
    engine.finalize_object()
    _ENGINES.append(engine)
    function = _PROTOTYPE(engine.get_function_address(code.symbol))

    def enter(what: int, arguments: bytes | int) -> int:
        memory = _RESULTS.memory
        status = function(_RESULTS.result, _RESULTS.exception, what, arguments)
        assert status == 0, f"compiled loops raise no exceptions, but this one did ({status})"
        return memory[0]

    return enter


def _resolve(names: tuple[str, ...]) -> None:
    """See that the machine code finds the functions that it calls; LLVM would end the process for one.

    Raises:
        ModelError: if there is one that is not in this process.
    """
    from llvmlite import binding

    binding.add_symbol(FREES_ARRAYS, ctypes.cast(_NEVER_CALLED, ctypes.c_void_p).value)
    missing = [name for name in names if not binding.address_of_symbol(name)]
    if missing:
        raise ModelError(
            f"the compiled loops need {', '.join(missing)}, which this system lacks; report it with your "
            "processor, operating system and version of numba"
        )


def _machine() -> Any:
    """Return LLVM's description of this machine, with numba's settings for code that runs at once."""
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    target = binding.Target.from_triple(binding.get_process_triple())
    relocation = "static" if target.name.startswith("x86") else "default"
    processor, features = _processor()
    return target.create_target_machine(
        cpu=processor, features=features, opt=3, reloc=relocation, codemodel="jitdefault", jit=True
    )


@cache
def _processor() -> tuple[str, str]:
    from llvmlite import binding

    try:
        features = binding.get_host_cpu_features().flatten()
    except RuntimeError:  # unknown on this system
        features = ""
    return binding.get_host_cpu_name(), features


@cache
def _file_name(name: str) -> str:
    """Return the name of an entry's file: which machine it is for, and what it was compiled from."""
    from llvmlite import binding

    machine = sha256(repr((binding.get_process_triple(), *_processor())).encode()).hexdigest()
    return f"loops-{name}-{machine[:16]}-{_sources(name)[:16]}.o"


def _sources(name: str) -> str:
    import llvmlite

    here = Path(__file__).parent
    digest = sha256(repr((sys.byteorder, llvmlite.__version__, _numba_version())).encode())
    for source in (*SOURCES[name], "entries", "compiling", "machine_code"):
        digest.update(sha256((here / f"{source}.py").read_bytes()).digest())
    return digest.hexdigest()


def _numba_version() -> bytes:
    """Return numba's file that says its version; numba itself is not imported."""
    found = find_spec("numba")
    assert found is not None and found.origin is not None, "numba is installed with this package"
    return Path(found.origin).with_name("_version.py").read_bytes()


def _folders() -> Iterator[Path]:
    """Yield where machine code is kept, like numba: beside the sources, or where the user can write."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        yield Path(chosen)
        return
    yield Path(__file__).parent / "__pycache__"
    with suppress(RuntimeError):  # no home
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "falsifier"
    own = own_temporary_folder("falsifier-numba")
    if own is not None:
        yield own
