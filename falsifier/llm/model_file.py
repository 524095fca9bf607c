"""A language model in a file (GGUF), served by llama.cpp's own server on this machine.

The server comes from the wheel of xllamacpp (the extra ``llama``). It is a program of its own: it starts when
the file is first asked for, serves all runs of this process and of those that it starts, and ends with it.
"""

import atexit
import os
import subprocess
import sys
import threading
from dataclasses import dataclass
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

from falsifier.core import posix
from falsifier.core.files import below_home, cache_directory
from falsifier.core.literals import printable
from falsifier.core.secrets import scrubbed
from falsifier.errors import ChatSetupError

SUFFIX = ".gguf"
# Tokens of prompt and reply together: prompts have up to 16,000, usually 6,000, and reasoning takes the rest.
CONTEXT = 32_768

_MAGIC = b"GGUF"
_LISTENING = "listening at "
# Address of a server that an ancestor of this process has started, by the file that it serves.
_VARIABLE = "FALSIFIER_SERVER_"
# Beyond the file itself: the context and the working memory of a model of middle size.
_MORE_BYTES = 1 << 30
_HASHED_BYTES = 1 << 20
_SHOWN_LINES = 3


@dataclass(frozen=True, slots=True)
class ServedModel:
    """A model file and the server that serves it."""

    name: str  # as the client library calls it
    address: str
    content: str  # size of the file and hash of its beginning, which identify what answers


def is_model_file(llm: str) -> bool:
    """Whether the name of a language model is the path of a file."""
    return llm.lower().endswith(SUFFIX)


def check_model_file(llm: str) -> Path:
    """Check a model file as far as that is possible without loading it; return its path.

    Raises:
        ChatSetupError: if it is not a model, the server is not installed, or memory is too small.
    """
    path = below_home(llm).absolute()
    try:
        with path.open("rb") as file:
            begins_well = file.read(len(_MAGIC)) == _MAGIC
        size = path.stat().st_size
    except OSError as error:
        raise ChatSetupError(f"{llm}: cannot read the file ({error.strerror or error})") from None
    if not begins_well:
        raise ChatSetupError(f"{llm}: not a GGUF file; download or convert the model in that format")
    if find_spec("xllamacpp") is None:
        raise ChatSetupError(
            f"{llm}: serving a model file needs llama.cpp's server: pip install 'falsifier[llama]'"
        )
    memory = posix.machine_memory()
    if size + _MORE_BYTES > memory:
        raise ChatSetupError(
            f"{llm}: the model needs about {(size + _MORE_BYTES) / 2**30:.1f} GiB of memory, and this "
            f"machine has {memory / 2**30:.1f} GiB; use a smaller model or a stronger quantization"
        )
    return path


def served(llm: str) -> ServedModel:
    """Return a model file's server, started if need be; ChatSetupError if that cannot be used or loaded."""
    path = check_model_file(llm)
    with _LOCK:
        address = _address_of(path) or _start(path)
    with path.open("rb") as file:
        beginning = sha256(file.read(_HASHED_BYTES)).hexdigest()[:16]
    return ServedModel(f"llamafile/{path.stem}", address, f"{path.stat().st_size}-{beginning}")


_LOCK = threading.Lock()
_SERVERS: dict[str, subprocess.Popen[str]] = {}


def _variable_of(path: Path) -> str:
    return _VARIABLE + sha256(str(path.resolve()).encode("utf-8", "replace")).hexdigest()[:16].upper()


def _address_of(path: Path) -> str | None:
    """Address of a running server for a file, started by this process or one that started it."""
    variable = _variable_of(path)
    own = _SERVERS.get(variable)
    if own is not None and own.poll() is not None:  # it has crashed
        del _SERVERS[variable]
        os.environ.pop(variable, None)
    return os.environ.get(variable)


def _start(path: Path) -> str:
    folder = cache_directory() / "servers"
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / f"{path.stem}.log"
    command = [sys.executable, "-m", "falsifier.llm.model_file", str(path), str(CONTEXT)]
    with log.open("w", encoding="utf-8") as errors:
        process = subprocess.Popen(
            command,
            env=scrubbed(os.environ),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            encoding="utf-8",
            errors="replace",
        )
    assert process.stdout is not None
    try:
        told = next((line for line in process.stdout if line.startswith(_LISTENING)), "")
    except BaseException:
        process.kill()
        raise
    if not told:
        process.wait()
        raise ChatSetupError(f"{path}: {_cause(log)}; the server's log: {log}")
    if not _SERVERS:
        atexit.register(_end_all)
    variable = _variable_of(path)
    _SERVERS[variable] = process
    os.environ[variable] = f"{told.removeprefix(_LISTENING).strip()}/v1"
    return os.environ[variable]


def _end_all() -> None:
    for variable, process in _SERVERS.items():
        os.environ.pop(variable, None)
        process.kill()
        process.wait()
    _SERVERS.clear()


def _cause(log: Path) -> str:
    """Why llama.cpp's server did not start, from its log."""
    lines = [printable(line).strip() for line in log.read_text("utf-8", "replace").splitlines()]
    said = [line for line in lines if "error" in line.lower() or "failed" in line.lower()]
    unknown = next((line for line in said if "unknown model architecture" in line), "")
    if unknown:
        architecture = unknown.rpartition(":")[2].strip()
        return f"this llama.cpp does not know the architecture {architecture}; update xllamacpp"
    if any("alloc" in line for line in said):
        return "not enough memory for this model; use a smaller one or a stronger quantization"
    return f"llama.cpp's server cannot load the model ({'; '.join((said or lines)[-_SHOWN_LINES:])})"


def _serve(model: str, context: int) -> None:
    """Serve until the standard input is closed, which is also when the process that asked for it ends."""
    import xllamacpp

    settings = xllamacpp.CommonParams()
    settings.model.path = model
    settings.n_ctx = context
    settings.n_parallel = 1
    settings.port = 0
    # One core is left for simulations; threads that outnumber the cores wait for each other.
    settings.cpuparams.n_threads = settings.cpuparams_batch.n_threads = max(1, (os.cpu_count() or 2) - 1)
    settings.use_jinja = True  # the model's own template
    settings.sampling.seed = 1  # the same questions get the same answers
    server = xllamacpp.Server(settings)
    print(f"{_LISTENING}{server.listening_address}", flush=True)
    sys.stdin.read()
    os._exit(0)  # the server's own end waits for replies that are being written


if __name__ == "__main__":
    _serve(sys.argv[1], int(sys.argv[2]))
