"""What lies inside an FMU beside its binaries: documentation, sources, texts, terminals, annotations."""

from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

from falsifier.errors import SpecError
from falsifier.fmu.description import UNREADABLE, open_archive, read_xml

_DOCUMENTS = (".html", ".htm", ".md", ".txt")
_RESOURCES = (".txt", ".md", ".json")
_SOURCES = (".c", ".h", ".mo")
_TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
_DESCRIPTION = "modelDescription.xml"
# Sources of the FMI itself and of exporters' solvers say nothing about the model.
_STANDARD = ("fmi2", "fmi3", "fmiplatform", "fmimodel", "sundials", "cvode")
_MAX_BYTES = 4 << 20
_MAX_FILES = 400
# What to do about a file inside an FMU that cannot be told: it cannot be left out alone.
NAME_THEM = "unpack the FMU, and name the files that matter with --context FILE instead of --context fmu"


def inside(fmu: Path) -> Iterator[tuple[str, bytes]]:
    """Return the names and contents of the files in an FMU that may say something about the model.

    Terminals and annotations are given as text, by the name of the file that has them.

    Raises:
        ModelError: if the FMU is not a zip archive, or a dangerous one.
        SpecError: naming a file that is too large or cannot be read, or if there are too many.
    """
    with open_archive(fmu) as archive:
        entries = [e for e in archive.infolist() if not e.is_dir() and _may_tell(PurePosixPath(e.filename))]
        if len(entries) > _MAX_FILES:
            raise SpecError(
                f"{fmu}: has {len(entries)} documents and sources, more than {_MAX_FILES}; {NAME_THEM}"
            )
        for entry in sorted(entries, key=lambda e: e.filename):
            if entry.file_size > _MAX_BYTES:
                raise SpecError(
                    f"{fmu}: {entry.filename} has {entry.file_size >> 20} MiB, more than {_MAX_BYTES >> 20}; "
                    f"{NAME_THEM}"
                )
            try:
                content = archive.read(entry)
            except UNREADABLE as error:
                raise SpecError(
                    f"{fmu}: {entry.filename} is damaged ({error}); copy or export the FMU again"
                ) from None
            if entry.filename in (_TERMINALS, _DESCRIPTION):
                root = read_xml(content, f"{fmu}: {entry.filename}", SpecError)
                lines = list(_terminals(root) if entry.filename == _TERMINALS else _annotations(root))
                content = "\n".join(lines).encode()
            if content.strip():
                yield entry.filename, content


def _may_tell(name: PurePosixPath) -> bool:
    if name.as_posix() in (_TERMINALS, _DESCRIPTION):
        return True
    folder, suffix = name.parts[0], name.suffix.lower()
    if folder == "sources":
        return suffix in _SOURCES and not name.name.lower().startswith(_STANDARD)
    return (folder == "documentation" and suffix in _DOCUMENTS) or (
        folder == "resources" and suffix in _RESOURCES
    )


def _terminals(root: Element) -> Iterator[str]:
    for terminal in root.iter("Terminal"):
        members = [
            f"{m.get('memberName') or m.get('variableName')} = {m.get('variableName')}"
            for m in terminal.iter("TerminalMemberVariable")
        ]
        kind = terminal.get("terminalKind") or terminal.get("matchingRule") or ""
        described = terminal.get("description")
        yield (
            f"terminal {terminal.get('name')}{f' ({kind})' if kind else ''}"
            f"{f', {described}' if described else ''}: {', '.join(members)}"
        )


def _annotations(root: Element) -> Iterator[str]:
    """Return the annotations of a model description, with the variables that they belong to."""
    for place in ("VendorAnnotations/Tool", "Annotations/Annotation"):
        yield from (_annotation(found, "") for found in root.findall(place))
    for variable in root.findall("ModelVariables/*"):
        for found in (*variable.findall("Annotations/Tool"), *variable.findall("Annotations/Annotation")):
            yield _annotation(found, f"{variable.get('name')}: ")


def _annotation(element: Element, of: str) -> str:
    kind = element.get("name") or element.get("type") or ""
    text = " ".join(" ".join(element.itertext()).split())
    values = [
        f"{inner.tag.rpartition('}')[2]} {' '.join(f'{k}={v}' for k, v in inner.attrib.items())}".strip()
        for inner in element.iter()
        if inner is not element
    ]
    return f"{of}annotation {kind}: {'; '.join(values)} {text}".strip()
