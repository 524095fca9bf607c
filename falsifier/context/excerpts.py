"""What may be told of a file: several forms of it, the fullest first, and thresholds found in it."""

import html
import json
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from types import MappingProxyType

from falsifier.context.c import c_comparisons
from falsifier.context.crossings import Definitions
from falsifier.context.modelica import modelica_comparisons, roots_of
from falsifier.context.simulink import Diagram, names_text, structure_text
from falsifier.context.simulink.diagram import upstream
from falsifier.context.simulink.expressions import definitions, diagram_thresholds
from falsifier.context.sources import Source, read_source, without_annotations
from falsifier.context.thresholds import Threshold
from falsifier.core.words import counted

_C = (".c", ".h", ".cpp", ".hpp")
_MODELICA = (".mo",)
_HTML = (".html", ".htm", ".xhtml")
# A page's parts: comments, what scripts and styles have, tags, other text. A tag ends at the latest where the
# next one begins, so that time grows with the length of a page.
_PAGE = re.compile(
    r"""<!--.*?(?:-->|\Z)
    | <(?P<skipped>script|style|head)\b[^<>]*+>
    | </?(?P<tag>[a-z][\w-]*+)(?:[^<>"']|"[^"<]*+"|'[^'<]*+')*+>
    | <[!?][^<>]*+>
    | (?P<text>[^<]++|<)""",
    re.VERBOSE | re.DOTALL | re.IGNORECASE,
)
_SKIPPED_TO = {
    "script": re.compile("</script", re.IGNORECASE),
    "style": re.compile("</style", re.IGNORECASE),
    "head": re.compile("</head|<body", re.IGNORECASE),  # a head may stay open
}
_BLOCK_TAGS = ("p", "br", "li", "tr", "div", "h1", "h2", "h3", "h4", "h5", "h6", "table", "pre")
_ENTITY = re.compile(r"&#?\w{1,32};?")
_HEADING = re.compile(r"(#{1,6}\s|=+\s|\d+(\.\d+)*\s+[A-Z])")
_SHOWN_NAMES = 60
_LONGEST_NAME = 200
# JSON that is longer than this does not fit, however it is written.
_LONGEST_WHOLE = 100_000


@dataclass(frozen=True, slots=True)
class Form:
    """One way to tell a file.

    Attributes:
        name: what it is, in words.
        text: makes it.
    """

    name: str
    text: Callable[[], str]


@dataclass(frozen=True, slots=True)
class Readable:
    """What a file contains.

    Attributes:
        forms: ways to tell it, the fullest first; the last one is always short.
        found: thresholds in what the requirement depends on.
        modes: names of signals with what the file says of their values.
        known: what it says of the values of variables.
    """

    forms: tuple[Form, ...]
    found: tuple[Threshold, ...] = ()
    modes: tuple[tuple[str, str], ...] = ()
    known: Definitions = field(default_factory=Definitions)


def of_diagram(diagram: Diagram, seeds: Collection[str]) -> Readable:
    """Return the forms of a Simulink file: its structure before a requirement's signals, or names."""
    only = upstream(diagram, seeds)
    whole = "structure" if only is None else "structure, as far as the requirement depends on it"
    forms = (
        Form(whole, lambda: structure_text(diagram, only)),
        Form("names only", lambda: names_text(diagram)),
        Form("name only", lambda: _short(diagram.name)),
    )
    found = tuple(diagram_thresholds(diagram, only))
    return Readable(forms, found, tuple(_modes(diagram)), Definitions(definitions(diagram)))


def parsed(text: str, shown: str) -> Source | None:
    """Return what a source says, by the ending of its name; None if it is no source, or too long."""
    suffix = PurePosixPath(shown).suffix.lower()
    if suffix not in (*_MODELICA, *_C):
        return None
    return read_source(text, shown, is_modelica=suffix in _MODELICA)


def of_text(
    text: str,
    shown: str,
    seeds: Collection[str],
    signals: Collection[str],
    *,
    is_named: bool = True,
    library: Mapping[str, Source] = MappingProxyType({}),
) -> Readable:
    """Return the forms of a text file, by the ending of its name.

    Args:
        text: its content.
        shown: its path.
        seeds: the requirement's signals.
        signals: all signals of the model.
        is_named: whether the user named this file; other sources are told only if they set one of ``seeds``.
        library: what all sources that were named say, by their text: a Modelica class may extend one of
            another file, C files may define each other's structures and macros.
    """
    source = library.get(text) or parsed(text, shown)
    if source is not None:
        others = [s for s in library.values() if s.is_modelica == source.is_modelica] or [source]
        found = _of_source(source, others, seeds, signals)
        is_met = is_named or not roots_of(seeds).isdisjoint(source.names_set)
        return found if is_met else Readable(found.forms[-1:])
    suffix = PurePosixPath(shown).suffix.lower()
    if suffix in _HTML:
        return _of_document(_without_tags(text), signals)
    if suffix == ".json":
        return _of_json(text, signals)
    return _of_document(text, signals)


def _of_source(
    source: Source, library: Sequence[Source], seeds: Collection[str], signals: Collection[str]
) -> Readable:
    compared = modelica_comparisons if source.is_modelica else c_comparisons
    limits, constants, known = compared(source, library, signals)
    kind, count = "class" if source.is_modelica else "function", sum(map(bool, source.scopes))
    forms = (
        Form("whole", lambda: _whole(source)),
        Form("parameters and comparisons", lambda: _listed(constants, limits)),
        Form("comparisons", lambda: _listed({}, limits)),
        Form("lines with the requirement's signals", lambda: "\n".join(_naming(source.text, "\n", seeds))),
        Form("size only", lambda: counted(count, kind)),
    )
    return Readable(forms, tuple(limits), known=known)


def _whole(source: Source) -> str:
    return (without_annotations(source.text) if source.is_modelica else source.text).strip()


def _listed(values: Mapping[str, str], limits: Iterable[Threshold]) -> str:
    stated = [f"{name} = {value}" for name, value in values.items()]
    return "\n".join([*stated, *(f"{t.text}  [{t.place}]" for t in limits)])


def _of_document(text: str, signals: Collection[str]) -> Readable:
    lines = [line.rstrip() for line in text.splitlines()]
    headings = [line for line in lines if _HEADING.match(line)]
    named = list(_naming(text, r"\n\s*\n", [name for name in signals if len(name) > 1]))
    forms = (
        Form("whole", lambda: "\n".join(lines).strip()),
        Form("headings, and paragraphs that name a signal", lambda: "\n".join([*headings, "", *named])),
        Form("paragraphs that name a signal", lambda: "\n".join(named)),
        Form("headings", lambda: "\n".join(headings)),
        Form("size only", lambda: counted(len(lines), "line")),
    )
    return Readable(tuple(form for form in forms if form.name == "size only" or form.text().strip()))


def _of_json(text: str, signals: Collection[str]) -> Readable:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return _of_document(text, signals)
    if not isinstance(content, (dict, list)):
        return _of_document(text, signals)
    keys = list(content) if isinstance(content, dict) else [counted(len(content), "element")]
    forms = (
        Form("whole", lambda: json.dumps(content, indent=1) if len(text) <= _LONGEST_WHOLE else text),
        Form("keys", lambda: ", ".join(map(str, keys))),
        Form("size only", lambda: counted(len(keys), "key")),
    )
    return Readable(forms)


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}... ({len(name):,} characters)"


def _naming(text: str, end: str, signals: Collection[str]) -> Iterator[str]:
    """Return the pieces of a text that name a signal, by the pattern between pieces."""
    names = {name.rpartition(".")[2] for name in signals}
    words = {name for name in names if name.isidentifier()}
    others = names - words
    for piece in re.split(end, text):
        if not words.isdisjoint(re.findall(r"\w+", piece)) or any(name in piece for name in others):
            yield " ".join(piece.split())


def _modes(diagram: Diagram) -> Iterator[tuple[str, str]]:
    """Return the outputs of charts with the states between which the chart switches."""
    for chart in diagram.charts:
        states = [state.name for state in chart.states]
        for data in chart.data:
            if data.scope == "output" and states:
                more = f", ... ({len(states)})" if len(states) > _SHOWN_NAMES else ""
                listed = ", ".join(map(_short, states[:_SHOWN_NAMES]))
                yield data.name, f"set by the chart {chart.name} with the states {listed}{more}"


def _without_tags(text: str) -> str:
    found: list[str] = []
    at = 0
    while at < len(text):
        part = _PAGE.match(text, at)
        assert part is not None
        at = part.end()
        if part["skipped"]:
            end = _SKIPPED_TO[part["skipped"].lower()].search(text, at)
            at = len(text) if end is None else end.start()
        elif part["tag"] and part["tag"].lower() in _BLOCK_TAGS:
            found.append("\n")
        elif part["text"]:
            found.append(re.sub(r"[ \t\r\f]+", " ", part["text"]))
    plain = _ENTITY.sub(lambda entity: html.unescape(entity[0]), "".join(found))
    return re.sub(r"\n{3,}", "\n\n", plain)
