"""Compiling an FMU that contains its C sources for this platform."""

import importlib.util
import re
import sysconfig
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

from falsifier.core.compiler import compile_c
from falsifier.errors import ModelError
from falsifier.fmu.description.archive import extract, library_file, this_platform
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.description.xml import read_xml
from falsifier.fmu.model import FmuModel

__all__ = ["compile_sources"]

# The standard's name, and that of drafts of FMI 3, which some exporters still write.
_BUILD_DESCRIPTIONS = ("buildDescription.xml", "build_description.xml")
_INCLUDED = re.compile(r'^\s*#\s*include\s*"([^"]+\.c)"', re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Sources:
    """What one library is compiled from.

    Attributes:
        files: paths of the C files below ``sources``.
        defines: preprocessor macros and their values.
        includes: folders below ``sources`` in which headers are looked up.
    """

    files: tuple[str, ...]
    defines: Mapping[str, str] = field(default_factory=dict)
    includes: tuple[str, ...] = (".",)


def compile_sources(path: Path, out: Path) -> Path:
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
        extract(path, folder)
        for identifier in sorted(set(description.identifiers.values())):
            sources = find_sources(path, folder, description.major, identifier)
            target = folder / library_file(description.info.fmi_version, identifier, this_platform())
            target.parent.mkdir(parents=True, exist_ok=True)
            _compile(path, folder / "sources", sources, target, description.major)
        _write(path, folder, out)
    return out


def _compile(path: Path, folder: Path, sources: Sources, target: Path, major: int) -> None:
    defines = [f"-D{name}={value}" if value else f"-D{name}" for name, value in sources.defines.items()]
    # FMI 2 and 3 sources may put a prefix before all function names, which libraries must not have. It has no
    # effect if the header is read before the sources define it. Sources that never include the header may
    # declare the standard's types on their own, which it would contradict.
    standard = f"fmi{major}Functions.h"
    header = ("-include", standard) if major > 1 and _includes(folder, standard) else ()
    compile_c(
        path,
        folder,
        [
            *("-O2", "-w", "-shared", "-fPIC"), *(f"-I{name}" for name in sources.includes),
            f"-I{_headers()}", *defines, *header, *sources.files,
            "-lm", "-o", str(target),
        ],
    )  # fmt: skip


def _includes(folder: Path, header: str) -> bool:
    """Return whether a file of the sources, headers too, includes this header."""
    directive = re.compile(rf'^\s*#\s*include\s*["<](?:[^">]*/)?{re.escape(header)}[">]', re.MULTILINE)
    return any(
        directive.search(file.read_text(encoding="utf-8", errors="replace"))
        for file in folder.rglob("*.[ch]")
        if file.is_file()
    )


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
        partial.replace(out)
    except ModelError as error:
        raise ModelError(f"{path}: the sources compile, but the result cannot be used: {error}") from error
    finally:
        partial.unlink(missing_ok=True)


def find_sources(path: Path, folder: Path, major: int, identifier: str) -> Sources:
    """Return what one library of an extracted FMU is compiled from.

    Files that the FMU lists, else all C files that no other C file includes.

    Args:
        path: path of the FMU, for messages.
        folder: folder to which it was extracted.
        major: major FMI version.
        identifier: model identifier of the library.

    Raises:
        ModelError: if there are no sources, or listed ones are missing.
    """
    root = folder / "sources"
    listed = _listed_2(path, folder, identifier) if major < 3 else _listed_3(path, root, identifier)
    files = listed.files or tuple(_unlisted(root))
    if not files:
        raise ModelError(f"{path}: contains no C sources; export it with sources or for this platform")
    missing = [f for f in files if not (root / f).is_file()]
    if missing:
        raise ModelError(f"{path}: the source files {', '.join(missing)} are missing; export it again")
    headers = (p.parent.relative_to(root).as_posix() for p in sorted(root.rglob("*.h")))
    return Sources(files, listed.defines, tuple(dict.fromkeys((".", *listed.includes, *headers))))


def _unlisted(root: Path) -> Iterator[str]:
    files = sorted(root.rglob("*.c"))
    included = {
        (file.parent / name).resolve()
        for file in files
        for name in _INCLUDED.findall(file.read_text(encoding="utf-8", errors="replace"))
    }
    return (f.relative_to(root).as_posix() for f in files if f.resolve() not in included)


def _listed_2(path: Path, folder: Path, identifier: str) -> Sources:
    root = _xml(path, folder / "modelDescription.xml")
    for interface in (*root.findall("CoSimulation"), *root.findall("ModelExchange")):
        files = tuple(f.attrib["name"] for f in interface.findall("SourceFiles/File"))
        if files and interface.get("modelIdentifier") == identifier:
            return Sources(files)
    return Sources(())


def _listed_3(path: Path, root: Path, identifier: str) -> Sources:
    described = next((root / name for name in _BUILD_DESCRIPTIONS if (root / name).is_file()), None)
    if described is None:
        return Sources(())
    configurations = _xml(path, described).findall("BuildConfiguration")
    own = [c for c in configurations if c.get("modelIdentifier", identifier) == identifier]
    # A configuration for another platform lists that platform's own files.
    general = [c for c in own if "platform" not in c.attrib] or own
    stated = {
        tag: [element.attrib for each in general[:1] for element in each.findall(f"SourceFileSet/{tag}")]
        for tag in ("SourceFile", "PreprocessorDefinition", "IncludeDirectory")
    }
    return Sources(
        tuple(file["name"] for file in stated["SourceFile"]),
        {macro["name"]: macro.get("value", "") for macro in stated["PreprocessorDefinition"]},
        tuple(folder["name"] for folder in stated["IncludeDirectory"]),
    )


def _xml(path: Path, described: Path) -> Element:
    return read_xml(described.read_bytes(), f"{path}: {described.name}", ModelError)
