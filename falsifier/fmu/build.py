"""Compiling an FMU that contains its C sources for this platform."""

import importlib.util
import sys
import sysconfig
import tempfile
import zipfile
from pathlib import Path

from falsifier.core import operating_system
from falsifier.errors import ModelError
from falsifier.fmu.compiler import compile_c
from falsifier.fmu.description import archive
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.simulator import FmuModel
from falsifier.fmu.sources import Sources, find_sources


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


def _compile(path: Path, folder: Path, sources: Sources, target: Path, major: int) -> None:
    defines = [f"-D{name}={value}" if value else f"-D{name}" for name, value in sources.defines.items()]
    # FMI 2 and 3 sources may put a prefix before all function names, which libraries must not have. It has no
    # effect if the header is read before the sources define it.
    header = ("-include", f"fmi{major}Functions.h") if major > 1 else ()
    compile_c(
        path,
        folder,
        [
            *("-O2", "-w", "-shared", "-fPIC"), *(f"-I{name}" for name in sources.includes),
            f"-I{_headers()}", *defines, *header, *sources.files,
            *(() if sys.platform == "win32" else ("-lm",)), "-o", str(target),
        ],
    )  # fmt: skip


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
