"""Parts of a Simulink package: from XML to the sections that the reader knows."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

from falsifier.context.simulink.tree import Node
from falsifier.errors import SpecError
from falsifier.fmu.description import UNREADABLE, open_archive, read_xml

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
