"""Compiling an FMU that contains its C sources for this platform."""

import importlib.util
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

from falsifier.core import operating_system
from falsifier.core.words import counted
from falsifier.errors import ModelError
from falsifier.fmu.description import archive
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.simulator import FmuModel
from falsifier.fmu.sources import Sources, find_sources

_COMPILERS = ("cc", "gcc", "clang")
# Generated code of large models can take many minutes to compile.
_TIME_LIMIT_SECONDS = 1800
_SHOWN_ERRORS = 5
_ERROR = re.compile(r"\berror:|undefined (reference|symbol)", re.IGNORECASE)


def build(path: Path, out: Path) -> Path:
    """Compile the sources of an FMU and write a copy of it with a library for this platform.

    The copy is loaded before it is written.

    Args:
        path: path of an FMU with sources.
        out: path of the FMU to write.

    Returns:
        The path of the FMU that was written.

    Raises:
        ModelError: if it has no sources, there is no compiler, the sources do not compile, or the result
            cannot be loaded.
    """
    description = read_description(path)
    with tempfile.TemporaryDirectory(prefix="falsifier-build-") as name:
        folder = Path(name)
        archive.extract(path, folder)
        for identifier in sorted(set(description.identifiers.values())):
            sources = find_sources(path, folder, description.major, identifier)
            target = folder / archive.library_file(description.info.fmi_version, identifier)
            target.parent.mkdir(parents=True, exist_ok=True)
            _compile(path, folder / "sources", sources, target, description.major)
        _write(path, folder, out)
    return out


def compiler() -> list[str]:
    """Return the command of a C compiler.

    Raises:
        ModelError: if there is none.
    """
    for name in _COMPILERS:
        if shutil.which(name):
            return [name]
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc"]
    raise ModelError(
        "no C compiler found (looked for cc, gcc, clang and the ziglang package); install one, for example "
        "with `pip install ziglang`"
    )


def _compile(path: Path, folder: Path, sources: Sources, target: Path, major: int) -> None:
    defines = [f"-D{name}={value}" if value else f"-D{name}" for name, value in sources.defines.items()]
    # FMI 2 and 3 sources may put a prefix before all function names, which libraries must not have. It has no
    # effect if the header is read before the sources define it.
    header = ("-include", f"fmi{major}Functions.h") if major > 1 else ()
    command: Sequence[str] = [
        *compiler(), "-O2", "-w", "-shared", "-fPIC", *(f"-I{name}" for name in sources.includes),
        f"-I{_headers()}", *defines, *header, *sources.files,
        *(() if sys.platform == "win32" else ("-lm",)), "-o", str(target),
    ]  # fmt: skip
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=_TIME_LIMIT_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ModelError(f"{path}: the compiler did not finish ({error})") from error
    if done.returncode:
        raise ModelError(f"{path}: the sources do not compile with {command[0]}: {_summary(done.stderr)}")


def _summary(said: str) -> str:
    """Return the compiler's errors in short: generated code repeats the same one hundreds of times."""
    lines = said.strip().splitlines()
    errors = [line.strip() for line in lines if _ERROR.search(line)]
    shown = list(dict.fromkeys(errors))[:_SHOWN_ERRORS] or lines[-_SHOWN_ERRORS:]
    count = f"{counted(len(errors), 'error')}, the first:" if len(errors) > len(shown) else ""
    return "\n  ".join([count, *shown])


def _headers() -> Path:
    """Return the folder of fmpy's FMI header files, for FMUs that do not contain them."""
    spec = importlib.util.find_spec("fmpy")
    if spec is None or not spec.submodule_search_locations:
        return Path(sysconfig.get_path("include"))
    return Path(spec.submodule_search_locations[0]) / "c-code"


def _write(path: Path, folder: Path, out: Path) -> None:
    """Pack the folder, load the result, and only then move it to its place."""
    partial = out.with_name(out.name + ".partial")
    try:
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as packed:
            for file in sorted(p for p in folder.rglob("*") if p.is_file()):
                packed.write(file, file.relative_to(folder).as_posix())
        for interface in read_description(partial).info.interfaces:
            FmuModel(partial, interface).load()
        operating_system.replace(partial, out)
    except ModelError as error:
        raise ModelError(f"{path}: the sources compile, but the result cannot be used: {error}") from error
    finally:
        partial.unlink(missing_ok=True)
