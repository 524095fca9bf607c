"""Sections of Simulink files, made from the text of ``.mdl`` files or the XML parts of ``.slx`` files."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

from falsifier.errors import SpecError
from falsifier.fmu.description.archive import entry_names, read_entries
from falsifier.fmu.description.xml import read_xml

_MAX_DEPTH = 200  # of sections, and of parts that refer to each other
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
# Far more than models have. Parts that refer twice to the next one could stand for billions of sections.
_MAX_SECTIONS = 2_000_000
_MAX_REFERENCES = 20_000


@dataclass(frozen=True, slots=True)
class Node:
    """One section of a Simulink file, such as a block, with its parameters and the sections within it."""

    kind: str  # Block, Line, state, ...
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


def parse_mdl(text: str, shown: str) -> Node:
    """Return the sections of a file of braces, within a section ``file``; SpecError naming a wrong line."""
    # Of each section around: what it is, its line, its values and the sections within it.
    opened: list[tuple[str, int, dict[str, str], list[Node]]] = [("file", 0, {}, [])]
    name, pieces = "", list[str]()  # of the latest value, if it is text: it may go on in lines of its own
    for number, line in enumerate(map(str.strip, text.split("\n")), start=1):
        if not line or line.startswith("#"):
            continue
        if pieces and (piece := _STRING.match(line)):
            pieces.append(_unescaped(piece[1]))
            continue
        _, _, values, children = opened[-1]
        if pieces:
            values[name], pieces = "".join(pieces), []
        if opening := _OPENING.match(line):
            if len(opened) > _MAX_DEPTH:
                raise SpecError(f"{shown}: line {number}: sections are nested more than {_MAX_DEPTH} deep")
            opened.append((opening[1], number, {}, []))
        elif line == "}":
            if len(opened) == 1:
                raise SpecError(f"{shown}: line {number}: a section is closed that was not opened")
            kind = opened.pop()[0]
            opened[-1][3].append(Node(kind, values, tuple(children)))
        else:
            found = _VALUE.match(line)
            string = _STRING.match(found[2]) if found else None
            if found is None or (found[2].startswith('"') and string is None):
                raise SpecError(
                    f"{shown}: line {number}: expected NAME VALUE, NAME {{ or }}, got {line[:60]!r}"
                )
            name, pieces = found[1], [_unescaped(string[1])] if string else []
            values[name] = pieces[0] if pieces else found[2]
    kind, begun, values, children = opened[-1]
    if len(opened) > 1:
        raise SpecError(f"{shown}: the section {kind} of line {begun} is not closed; it ends too early")
    return Node(kind, values, tuple(children))


def text_parts(text: str) -> dict[str, bytes]:
    """Return the parts of a package as newer versions write it into a ``.mdl`` file, by name.

    Empty if it is no package; binary parts are left out.
    """
    parts: dict[str, list[str]] = {}
    inside: list[str] | None = None
    for line in text.partition(_PACKAGE)[2].split("\n"):
        if line.startswith(_PART):
            name, _, encoding = line[len(_PART) :].strip().partition(" ")
            inside = [] if encoding.strip() else parts.setdefault(name.lstrip("/"), [])
        elif line.startswith(_END):
            inside = None
        elif inside is not None:
            inside.append(line)
    return {name: "\n".join(lines).encode() for name, lines in parts.items()}


def _unescaped(text: str) -> str:
    return _ESCAPE.sub(lambda found: {"n": "\n", "t": "\t"}.get(found[1], found[1]), text)


def read_parts(path: Path) -> dict[str, bytes]:
    """Return the parts of a ``.slx`` file that describe the model, by name.

    Raises:
        ModelError: if it is not a zip archive, or a dangerous one.
        SpecError: naming the part that is damaged or too large.
    """
    wanted = (name for name in entry_names(path) if name.lower().startswith(_READ))
    names = [name for name in wanted if name.lower().endswith(".xml")]
    smaller = "save the subsystem that matters as a model of its own"
    return dict(read_entries(path, names, _MAX_PART_BYTES, smaller=smaller, again="save the model again"))


class ModelPackage:
    """The parts of a package, by their names in small letters, and what errors call the file."""

    def __init__(self, parts: Mapping[str, bytes], shown: str) -> None:
        self._parts = {name.lower(): text for name, text in parts.items()}
        self._stems = {PurePosixPath(name).stem: name for name in reversed(self._parts)}
        self._shown = shown
        self._sections = self._references = 0

    def tree(self) -> Node:
        """Return the sections of the model as in a ``.mdl`` file, then those of parts that nothing refers to.

        Raises:
            SpecError: naming the part that is missing or cannot be read.
        """
        found = [*self._root(_DIAGRAM).children]
        beside = [name for name in (_DEFAULTS, _STATEFLOW) if name in self._parts]
        for name in (*beside, *sorted(name for name in self._parts if name.startswith(_SETTINGS))):
            root = self._root(name)
            found += root.children if root.kind in ("BlockDiagramDefaults", "ModelInformation") else (root,)
        reached = {node.get("id") for top in found for node in top.walk() if node.kind == "chart"}
        charts = (self._root(name) for name in sorted(self._parts) if name.startswith(f"{_CHARTS}chart"))
        return Node("file", {}, (*found, *(chart for chart in charts if chart.get("id") not in reached)))

    def _root(self, name: str, within: tuple[str, ...] = ()) -> Node:
        """Return the root section of a part with all that it refers to."""
        if name not in self._parts:
            raise SpecError(f"{self._shown}: the part {name} is missing; save the model again")
        return self._node(read_xml(self._parts[name], f"{self._shown}: {name}", SpecError), (*within, name))

    def _node(self, element: Element, within: tuple[str, ...]) -> Node:
        self._sections += 1
        if self._sections > _MAX_SECTIONS:
            raise SpecError(f"{self._shown}: its parts have more than {_MAX_SECTIONS:,} sections together")
        values = dict(element.attrib)
        children: list[Node] = []
        for child in _ungrouped(element):
            if child.tag == "P":
                values[child.get("Name", "")] = "".join(child.itertext())
            elif "Ref" in child.attrib and not len(child):
                children.append(self._referenced(child.attrib["Ref"].lower(), within))
            else:
                children.append(self._node(child, within))
        return Node(element.tag, values, tuple(children))

    def _referenced(self, stem: str, within: tuple[str, ...]) -> Node:
        """Return the root section of the part that a reference stands for."""
        self._references += 1
        name = self._stems.get(stem, f"{stem}.xml")
        if name in within or len(within) > _MAX_DEPTH:
            raise SpecError(f"{self._shown}: {within[-1]}: refers to {name}, which contains it")
        if self._references > _MAX_REFERENCES:
            raise SpecError(f"{self._shown}: its parts refer to others more than {_MAX_REFERENCES:,} times")
        return self._root(name, within)


def _ungrouped(element: Element) -> Iterator[Element]:
    """Return what is within an element; some elements only group others."""
    for child in element:
        yield from child if child.tag == "Children" else (child,)
