"""Files as they are named: their text, what lies inside an FMU, and secrets in them, which are refused."""

import codecs
import re
from collections.abc import Collection, Iterator
from pathlib import Path, PurePosixPath

from falsifier.core.secrets import line_of_held_secret, line_of_secret
from falsifier.errors import SpecError, setting
from falsifier.fmu.description.archive import entry_names, read_entries

_DOCUMENTS = (".html", ".htm", ".md", ".txt")
_RESOURCES = (".txt", ".md", ".json")
_SOURCES = (".c", ".h", ".mo")
# Sources of the FMI itself and of exporters' solvers say nothing about the model.
_STANDARD = ("fmi2", "fmi3", "fmiplatform", "fmimodel", "sundials", "cvode")
_MAX_BYTES = 4 << 20
_MAX_FILES = 400
# What to do about a file inside an FMU that cannot be told: it cannot be left out alone.
NAME_THEM = "unpack the FMU, and name the files that matter as context instead of fmu"
# The mark of UTF-32 begins like that of UTF-16.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
# PDF and RTF: what they show stands between codes, even if these have no control characters.
_CODED = (b"%PDF-", rb"{\rtf")
# Control characters that no editor writes: what is not UTF-8 and has them is binary.
_CONTROL = re.compile(r"[\x01-\x08\x0e-\x19\x1c-\x1f]")


def inside(fmu: Path) -> Iterator[tuple[str, bytes]]:
    """Return the names and contents of the files in an FMU that may say something about the model.

    Raises:
        ModelError: if the FMU is not a zip archive, or a dangerous one.
        SpecError: naming a file that is too large or cannot be read, or if there are too many.
    """
    names = [name for name in entry_names(fmu) if not name.endswith("/") and _may_tell(PurePosixPath(name))]
    if len(names) > _MAX_FILES:
        raise SpecError(f"{fmu}: has {len(names)} documents and sources, more than {_MAX_FILES}; {NAME_THEM}")
    again = "copy or export the FMU again"
    found = read_entries(fmu, sorted(names), _MAX_BYTES, smaller=NAME_THEM, again=again)
    yield from ((name, content) for name, content in found if content.strip())


def _may_tell(name: PurePosixPath) -> bool:
    folder, suffix = name.parts[0], name.suffix.lower()
    if folder == "sources":
        return suffix in _SOURCES and not name.name.lower().startswith(_STANDARD)
    return (folder == "documentation" and suffix in _DOCUMENTS) or (
        folder == "resources" and suffix in _RESOURCES
    )


def text_of(content: bytes) -> str | None:
    """Return the text of a file by the mark it begins with, else UTF-8, Windows-1252 or Latin-1.

    Lines end as on this machine, whichever machine wrote them. None for binary data, and for PDF and RTF.

    >>> text_of("5 K".encode("utf-16")), text_of(bytes([53, 176])), text_of(bytes(4))
    ('5 K', '5°', None)
    """
    if content.startswith(_CODED):
        return None
    encoding = next((name for mark, name in _MARKS if content.startswith(mark)), "")
    if encoding:
        text = _decoded(content, encoding)
    elif (text := _decoded(content, "utf-8")) is None:
        # Windows-1252 has quotes and dashes where Latin-1 has control characters.
        text = _decoded(content, "cp1252") or content.decode("latin-1")
        if _CONTROL.search(text):
            return None
    return None if text is None or "\0" in text else text.replace("\r\n", "\n").replace("\r", "\n")


def _decoded(content: bytes, encoding: str) -> str | None:
    try:
        return content.decode(encoding)
    except UnicodeDecodeError:
        return None


class Sentry:
    """Looks at every text of a file before it is told, and notes what the user allowed."""

    def __init__(self, checked: Collection[str]) -> None:
        self._checked = frozenset(checked)
        self.notes: list[str] = []
        self._unused = set(checked)

    def look(self, text: str, shown: str, file: str, otherwise: str) -> None:
        """Refuse a text that is to be told, or that this is made of, if it looks like a secret.

        Messages tell the place as ``shown``, the ``file`` by the name with which a user may allow it, and
        what to do ``otherwise``.

        Raises:
            SpecError: naming file and line, never the line's text.
        """
        self._unused.discard(file)
        line = line_of_held_secret(text)
        if line is not None:
            raise SpecError(
                f"context {shown}: line {line} has the value of an environment variable that is named like a "
                f"key, token or password, so nothing is sent; {otherwise}"
            )
        line = line_of_secret(text)
        if line is None:
            return
        if file not in self._checked:
            raise SpecError(
                f"context {shown}: line {line} looks like a key, token or password, so nothing is sent; "
                f"{otherwise}; if it is not, allow this file with {setting('context')} "
                f"'checked:{file}', or with checked = ['{file}'] in the spec's [context]"
            )
        note = f"context {shown}: line {line} looks like a key, token or password, and was allowed"
        if note not in self.notes:
            self.notes.append(note)

    def refuse_unused(self) -> None:
        """Refuse checked files at which nothing was looked: they may be misspelt; SpecError naming them."""
        if self._unused:
            raise SpecError(
                f"context: checked names {', '.join(sorted(self._unused))}, which is not read; use the "
                "file's name as in the message about it, or drop it"
            )
