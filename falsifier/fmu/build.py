"""Compiling an FMU that contains its C sources for this platform."""

import importlib.util
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from falsifier.errors import ModelError
from falsifier.fmu import archive
from falsifier.fmu.description import read_description

_COMPILERS = ("cc", "gcc", "clang")
# Generated code of large models can take many minutes to compile.
_TIME_LIMIT_SECONDS = 1800
_SHOWN_LINES = 20


@dataclass(frozen=True, slots=True)
class _Sources:
    """What one library is compiled from: file names below ``sources``, and preprocessor macros."""

    files: tuple[str, ...]
    defines: Mapping[str, str]


def build(path: Path, out: Path) -> Path:
    """Compile the sources of an FMU and write a copy of it with a library for this platform.

    Args:
        path: path of an FMU with sources.
        out: path of the FMU to write.

    Returns:
        The path of the FMU that was written.

    Raises:
        ModelError: if it has no sources, there is no compiler, or the sources do not compile.
    """
    description = read_description(path)
    with tempfile.TemporaryDirectory(prefix="falsifier-build-") as name:
        folder = Path(name)
        archive.extract(path, folder)
        for identifier in sorted(set(description.identifiers.values())):
            sources = _find_sources(path, folder, description.major, identifier)
            target = folder / archive.library_file(description.info.fmi_version, identifier)
            target.parent.mkdir(parents=True, exist_ok=True)
            _compile(path, folder / "sources", sources, target)
        _pack(folder, out)
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


def _find_sources(path: Path, folder: Path, major: int, identifier: str) -> _Sources:
    """Return the files and macros of one library as listed in the FMU; if none are listed, all C files."""
    listed = _listed_3(folder) if major == 3 else _listed_2(folder, identifier)
    everything = sorted(str(p.relative_to(folder / "sources")) for p in (folder / "sources").glob("*.c"))
    files = listed.files or tuple(everything)
    if not files:
        raise ModelError(f"{path}: contains no C sources; export it with sources or for this platform")
    missing = [f for f in files if not (folder / "sources" / f).is_file()]
    if missing:
        raise ModelError(f"{path}: the source files {', '.join(missing)} are missing; export it again")
    return _Sources(files, listed.defines)


def _listed_2(folder: Path, identifier: str) -> _Sources:
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    for interface in (*root.findall("CoSimulation"), *root.findall("ModelExchange")):
        files = tuple(f.attrib["name"] for f in interface.findall("SourceFiles/File"))
        if files and interface.get("modelIdentifier") == identifier:
            return _Sources(files, {})
    return _Sources((), {})


def _listed_3(folder: Path) -> _Sources:
    build_description = folder / "sources" / "buildDescription.xml"
    if not build_description.is_file():
        return _Sources((), {})
    root = ElementTree.parse(build_description).getroot()
    files = tuple(f.attrib["name"] for f in root.findall("BuildConfiguration/SourceFileSet/SourceFile"))
    macros = root.findall("BuildConfiguration/SourceFileSet/PreprocessorDefinition")
    return _Sources(files, {m.attrib["name"]: m.get("value", "") for m in macros})


def _compile(path: Path, folder: Path, sources: _Sources, target: Path) -> None:
    defines = [f"-D{name}={value}" if value else f"-D{name}" for name, value in sources.defines.items()]
    command: Sequence[str] = [
        *compiler(), "-O2", "-w", "-shared", "-fPIC", "-I.", f"-I{_headers()}", *defines,
        *sources.files, *(() if sys.platform == "win32" else ("-lm",)), "-o", str(target),
    ]  # fmt: skip
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=_TIME_LIMIT_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ModelError(f"{path}: the compiler did not finish ({error})") from error
    if done.returncode:
        said = "\n".join(done.stderr.strip().splitlines()[:_SHOWN_LINES])
        raise ModelError(f"{path}: the sources do not compile with {command[0]}:\n{said}")


def _headers() -> Path:
    """Return the folder of fmpy's FMI header files, for FMUs that do not contain them."""
    spec = importlib.util.find_spec("fmpy")
    if spec is None or not spec.submodule_search_locations:
        return Path(sysconfig.get_path("include"))
    return Path(spec.submodule_search_locations[0]) / "c-code"


def _pack(folder: Path, out: Path) -> None:
    partial = out.with_name(out.name + ".partial")
    with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as packed:
        for file in sorted(p for p in folder.rglob("*") if p.is_file()):
            packed.write(file, file.relative_to(folder).as_posix())
    partial.replace(out)
