"""Sections of Simulink files, made from the text of ``.mdl`` files or the XML parts of ``.slx`` files."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

from falsifier.errors import SpecError
from falsifier.fmu.description import UNREADABLE, open_archive, read_xml

_MAX_DEPTH = 200
_OPENING = re.compile(r"([\w.$:/+-]++)\s*+\{$")
_STRING = re.compile(r'"((?:[^"\\]|\\.)*+)"$')
_VALUE = re.compile(r"([\w.$:/+-]++)\s++(.*)$")
_ESCAPE = re.compile(r"\\(.)")
_PACKAGE = "__MWOPC_PACKAGE_BEGIN__"
_PART = "__MWOPC_PART_BEGIN__"
_END = "__MWOPC_PACKAGE_END__"
_DIAGRAM = "simulink/blockdiagram.xml"
_DEFAULTS = "simulink/bddefaults.xml"
_STATEFLOW = "simulink/stateflow.xml"
_CHARTS = "simulink/stateflow/"
_SETTINGS = "simulink/configset"
# A part of 10,000 blocks takes some 5 MB.
_MAX_PART_BYTES = 64 << 20
# Only these are read; a package also contains pictures, histories and caches.
_READ = (_DIAGRAM, _DEFAULTS, _STATEFLOW, _CHARTS, _SETTINGS, "simulink/systems/")
# Sections that only group what is within them.
_GROUPS = ("Children",)
_MAX_NESTING = 200
# Far more than models have. Parts that refer twice to the next one could stand for billions of sections.
_MAX_SECTIONS = 2_000_000
_MAX_REFERENCES = 20_000


@dataclass(frozen=True, slots=True)
class Node:
    """One section of a Simulink file, such as a block.

    Attributes:
        kind: what it is: ``Block``, ``Line``, ``state``, ...
        values: its parameters by name, as text.
        children: the sections within it, in order.
    """

    kind: str
    values: Mapping[str, str] = field(default_factory=dict)
    children: tuple["Node", ...] = ()

    def get(self, *names: str) -> str:
        """Return the first of these values that is present; empty if none is."""
        return next((self.values[name] for name in names if name in self.values), "")

    def all(self, kind: str) -> tuple["Node", ...]:
        """Return the sections of this kind directly within."""
        return tuple(child for child in self.children if child.kind == kind)

    def first(self, kind: str) -> "Node | None":
        """Return the first section of this kind directly within."""
        return next((child for child in self.children if child.kind == kind), None)

    def walk(self) -> Iterator["Node"]:
        """Return this section and all within it, outer ones first."""
        queue = [self]
        while queue:
            node = queue.pop()
            yield node
            queue.extend(reversed(node.children))


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


def read_parts(path: Path) -> dict[str, bytes]:
    """Return the parts of a ``.slx`` file that describe the model, by name.

    Raises:
        ModelError: if it is not a zip archive, or a dangerous one.
        SpecError: naming the part that is damaged or too large.
    """
    parts = {}
    with open_archive(path) as archive:
        for entry in archive.infolist():
            name = entry.filename
            if not name.lower().startswith(_READ) or not name.lower().endswith(".xml"):
                continue
            if entry.file_size > _MAX_PART_BYTES:
                raise SpecError(
                    f"{path}: {name} has {entry.file_size >> 20} MiB, more than {_MAX_PART_BYTES >> 20}; "
                    "save the subsystem that matters as a model of its own"
                )
            try:
                parts[name] = archive.read(entry)
            except UNREADABLE as error:
                raise SpecError(f"{path}: {name} is damaged ({error}); save the model again") from None
    return parts


def as_tree(parts: Mapping[str, bytes], shown: str) -> Node:
    """Return the sections of a package, arranged as in a ``.mdl`` file.

    Args:
        parts: contents of the parts by name.
        shown: what errors call the file.

    Raises:
        SpecError: naming the part that is missing or cannot be read.
    """
    lowered = {name.lower(): text for name, text in parts.items()}
    stems = {PurePosixPath(name).stem: name for name in reversed(lowered)}
    package = _Package(lowered, shown, stems)
    found = [*package.root(_DIAGRAM).children]
    found += [
        child for name in (_DEFAULTS, _STATEFLOW) if name in package.parts for child in package.of(name)
    ]
    found += [child for name in package.settings for child in package.of(name)]
    reached = {node.get("id") for top in found for node in top.walk() if node.kind == "chart"}
    found += [c for name in package.charts for c in package.of(name) if c.get("id") not in reached]
    return Node("file", {}, tuple(found))


@dataclass(frozen=True, slots=True)
class _Package:
    parts: Mapping[str, bytes]
    shown: str
    stems: Mapping[str, str]
    sections: Iterator[int] = field(default_factory=lambda: count(1))
    references: Iterator[int] = field(default_factory=lambda: count(1))

    @property
    def settings(self) -> list[str]:
        return sorted(name for name in self.parts if name.startswith(_SETTINGS))

    @property
    def charts(self) -> list[str]:
        return sorted(name for name in self.parts if name.startswith(f"{_CHARTS}chart"))

    def root(self, name: str, within: tuple[str, ...] = ()) -> Node:
        """Return the root section of a part with all that it refers to."""
        if name not in self.parts:
            raise SpecError(f"{self.shown}: the part {name} is missing; save the model again")
        element = read_xml(self.parts[name], f"{self.shown}: {name}", SpecError)
        return self._node(element, (*within, name))

    def of(self, name: str) -> tuple[Node, ...]:
        """Return the root section of a part, or what is in it if it only groups."""
        root = self.root(name)
        return root.children if root.kind in ("BlockDiagramDefaults", "ModelInformation") else (root,)

    def _node(self, element: Element, within: tuple[str, ...]) -> Node:
        if next(self.sections) > _MAX_SECTIONS:
            raise SpecError(f"{self.shown}: its parts have more than {_MAX_SECTIONS:,} sections together")
        values = dict(element.attrib)
        children: list[Node] = []
        for child in _ungrouped(element):
            if child.tag == "P":
                values[child.get("Name", "")] = "".join(child.itertext())
            elif "Ref" in child.attrib and not len(child):
                children.append(self._referenced(child, within))
            else:
                children.append(self._node(child, within))
        return Node(element.tag, values, tuple(children))

    def _referenced(self, element: Element, within: tuple[str, ...]) -> Node:
        """Return the root section of the part that an element stands for."""
        stem = element.attrib["Ref"].lower()
        name = self.stems.get(stem, f"{stem}.xml")
        if name in within or len(within) > _MAX_NESTING:
            raise SpecError(f"{self.shown}: {within[-1]}: refers to {name}, which contains it")
        if next(self.references) > _MAX_REFERENCES:
            raise SpecError(f"{self.shown}: its parts refer to others more than {_MAX_REFERENCES:,} times")
        return self.root(name, within)


def _ungrouped(element: Element) -> Iterator[Element]:
    for child in element:
        if child.tag in _GROUPS:
            yield from child
        else:
            yield child
