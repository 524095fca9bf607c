"""Compiling an FMU that contains its C sources for this platform."""

import importlib.util
import re
import tempfile
import zipfile
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

from falsifier.core.compiler import compile_c
from falsifier.errors import ModelError
from falsifier.fmu.description.archive import extract, library_file, this_platform
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.description.xml import read_xml
from falsifier.fmu.model import FmuModel

# The standard's name, and that of drafts of FMI 3, which some exporters still write.
_BUILD_DESCRIPTIONS = ("buildDescription.xml", "build_description.xml")
_INCLUDED = re.compile(r'^\s*#\s*include\s*["<]([^">\n\0]+)[">]', re.MULTILINE)


def compile_sources(path: Path, out: Path) -> Path:
    """Compile the sources of an FMU and write a copy of it with a library for this platform.

    The copy is loaded before it is written.

    Returns:
        The path of the FMU that was written.

    Raises:
        ModelError: if sources or a compiler are missing, or the sources or the result do not work.
    """
    description = read_description(path)
    with tempfile.TemporaryDirectory(prefix="falsifier-build-") as name:
        folder = Path(name).absolute()  # TMPDIR may be relative, and compilers run elsewhere
        extract(path, folder)
        for identifier in sorted(set(description.identifiers.values())):
            target = folder / library_file(description.info.fmi_version, identifier, this_platform())
            target.parent.mkdir(parents=True, exist_ok=True)
            _compile(path, folder, description.major, identifier, target)
        _write(path, folder, out)
    return out


def _compile(path: Path, folder: Path, major: int, identifier: str, target: Path) -> None:
    """Compile one library: the files that the FMU lists, else all C files that no other file includes."""
    root = folder / "sources"
    stated = _listed_2(path, folder, identifier) if major < 3 else _listed_3(path, root, identifier)
    files = [each.get("name", "") for each in stated.get("SourceFile", ())]
    included = _included(root)
    if not files:
        found = [file.relative_to(root) for file in sorted(root.rglob("*.c"))]
        files = [str(file) for file in found if (root / file).resolve() not in included]
    if not files:
        raise ModelError(f"{path}: contains no C sources; export it with sources or for this platform")
    if stray := [file for file in files if PurePosixPath(file).is_absolute() or ".." in file.split("/")]:
        raise ModelError(f"{path}: the source files {', '.join(stray)} are outside sources/; export it again")
    missing = [file for file in files if not (root / file).is_file()]
    if missing:
        raise ModelError(f"{path}: the source files {', '.join(missing)} are missing; export it again")
    macros = [(each.get("name", ""), each.get("value")) for each in stated.get("PreprocessorDefinition", ())]
    folders = [".", *(each.get("name", ".") for each in stated.get("IncludeDirectory", ()))]
    folders += [str(header.parent.relative_to(root)) for header in sorted(root.rglob("*.h"))]
    # FMI 2 and 3 sources may put a prefix before all function names, which libraries must not have. It has no
    # effect if the header is read before the sources define it. Sources that never include the header may
    # declare the standard's types on their own, which it would contradict. It reads the system's headers,
    # so the sources cannot ask these for more any longer, as OpenModelica's do.
    standard = f"fmi{major}Functions.h"
    early = major > 1 and standard in {file.name for file in included}
    header = ("-D_GNU_SOURCE", "-include", standard) if early else ()
    compile_c(
        path,
        root,
        [
            *("-O2", "-w", "-shared", "-fPIC"), *(f"-I{name}" for name in dict.fromkeys(folders)),
            f"-I{_headers()}", *(f"-D{name}={value}" if value else f"-D{name}" for name, value in macros),
            # Names begin with a folder: compilers take those with a dash or an at sign for options.
            *header, *(f"./{name}" for name in files), "-lm", "-o", str(target),
        ],
    )  # fmt: skip


def _included(root: Path) -> set[Path]:
    """Return the paths of what files of the sources, headers too, include, seen from their folders."""
    return {
        (file.parent / name).resolve()
        for file in root.rglob("*.[ch]")
        if file.is_file()
        for name in _INCLUDED.findall(file.read_text(encoding="utf-8", errors="replace"))
    }


def _headers() -> Path:
    """Return the folder of fmpy's FMI header files, for FMUs that do not contain them."""
    spec = importlib.util.find_spec("fmpy")
    assert spec is not None and spec.origin is not None, "fmpy is installed with this package"
    return Path(spec.origin).parent / "c-code"


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


def _listed_2(path: Path, folder: Path, identifier: str) -> dict[str, list[Element]]:
    root = _xml(path, folder / "modelDescription.xml")
    for interface in (*root.findall("CoSimulation"), *root.findall("ModelExchange")):
        files = interface.findall("SourceFiles/File")
        if files and interface.get("modelIdentifier") == identifier:
            return {"SourceFile": files}
    return {}


def _listed_3(path: Path, root: Path, identifier: str) -> dict[str, list[Element]]:
    described = next((root / name for name in _BUILD_DESCRIPTIONS if (root / name).is_file()), None)
    if described is None:
        return {}
    configurations = _xml(path, described).findall("BuildConfiguration")
    own = [c for c in configurations if c.get("modelIdentifier", identifier) == identifier]
    # A configuration for another platform lists that platform's own files.
    general = [c for c in own if "platform" not in c.attrib] or own
    kinds = ("SourceFile", "PreprocessorDefinition", "IncludeDirectory")
    return {k: [e for each in general[:1] for e in each.findall(f"SourceFileSet/{k}")] for k in kinds}


def _xml(path: Path, described: Path) -> Element:
    return read_xml(described.read_bytes(), f"{path}: {described.name}", ModelError)
