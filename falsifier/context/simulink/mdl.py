"""Text of ``.mdl`` files: sections in braces with one value per line, and packages written as text."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from falsifier.context.simulink.tree import Node
from falsifier.errors import SpecError

_MAX_DEPTH = 200
_OPENING = re.compile(r"([\w.$:/+-]++)\s*+\{$")
_STRING = re.compile(r'"((?:[^"\\]|\\.)*+)"$')
_VALUE = re.compile(r"([\w.$:/+-]++)\s++(.*)$")
_ESCAPE = re.compile(r"\\(.)")
_PACKAGE = "__MWOPC_PACKAGE_BEGIN__"
_PART = "__MWOPC_PART_BEGIN__"
_END = "__MWOPC_PACKAGE_END__"


@dataclass(slots=True)
class _Section:
    kind: str
    line: int
    values: dict[str, list[str]] = field(default_factory=dict)  # pieces of each
    children: list[Node] = field(default_factory=list)
    last: str = ""


def parse_mdl(text: str, shown: str) -> Node:
    """Return the sections of a file of braces, within a section ``file``.

    Raises:
        SpecError: naming the file and the line that cannot be read.
    """
    stack = [_Section("file", 0)]
    for number, line in _lines(text):
        if opening := _OPENING.match(line):
            if len(stack) > _MAX_DEPTH:
                raise SpecError(f"{shown}: line {number}: sections are nested more than {_MAX_DEPTH} deep")
            stack.append(_Section(opening[1], number))
        elif line == "}":
            if len(stack) == 1:
                raise SpecError(f"{shown}: line {number}: a section is closed that was not opened")
            closed = stack.pop()
            stack[-1].children.append(_node(closed))
        elif not _add(stack[-1], line):
            raise SpecError(f"{shown}: line {number}: expected NAME VALUE, NAME {{ or }}, got {line[:60]!r}")
    if len(stack) > 1:
        raise SpecError(
            f"{shown}: the section {stack[-1].kind} of line {stack[-1].line} is not closed; it ends too early"
        )
    return _node(stack[0])


def _node(closed: _Section) -> Node:
    values = {name: "".join(pieces) for name, pieces in closed.values.items()}
    return Node(closed.kind, values, tuple(closed.children))


def is_text_package(text: str) -> bool:
    """Whether a ``.mdl`` file contains the parts of a package, as newer versions write it."""
    return _PACKAGE in text


def text_parts(text: str) -> dict[str, bytes]:
    """Return the parts of a package that is written as text, by name; binary parts are left out."""
    parts: dict[str, list[str]] = {}
    inside: list[str] | None = None
    for line in text[text.index(_PACKAGE) :].splitlines():
        if line.startswith(_PART):
            name, _, encoding = line[len(_PART) :].strip().partition(" ")
            inside = [] if encoding.strip() else parts.setdefault(name.lstrip("/"), [])
        elif line.startswith(_END):
            inside = None
        elif inside is not None:
            inside.append(line)
    return {name: "\n".join(lines).encode() for name, lines in parts.items()}


def _lines(text: str) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(text.splitlines(), start=1):
        stripped = line.strip()
        if stripped and not stripped.startswith("#"):
            yield number, stripped


def _add(section: _Section, line: str) -> bool:
    """Add a value, or the next piece of the last one; return whether the line is either."""
    if line.startswith('"'):
        piece = _STRING.match(line)
        if piece is None or not section.last:
            return False
        section.values[section.last].append(_unescaped(piece[1]))
        return True
    found = _VALUE.match(line)
    if found is None:
        return False
    name, value = found[1], found[2].strip()
    quoted = _STRING.match(value)
    if value.startswith('"') and quoted is None:
        return False
    section.values[name] = [_unescaped(quoted[1]) if quoted else value]
    section.last = name if quoted else ""
    return True


def _unescaped(text: str) -> str:
    return _ESCAPE.sub(lambda found: {"n": "\n", "t": "\t"}.get(found[1], found[1]), text)
