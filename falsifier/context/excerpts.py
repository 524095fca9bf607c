"""What may be told of a file: several forms of it, the fullest first, and thresholds found in it."""

import html
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from falsifier.context.simulink import Diagram, names_text, structure_text
from falsifier.context.simulink.comparisons import diagram_thresholds
from falsifier.context.simulink.diagram import upstream
from falsifier.context.sources import Source, constants_of, without_annotations
from falsifier.context.thresholds import Threshold, thresholds
from falsifier.core.words import counted, shortened

_HTML = (".html", ".htm", ".xhtml")
# What a page does not show, with its tags; where a head ends that stays open. Every pattern takes what it has
# looked at, so that time grows with the length of a page.
_HIDDEN = re.compile(
    r"<!--.*?(?:-->|\Z)|<(script|style)\b.*?(?:</\1\s*+>|\Z)|<head\b.*?(?:</head\s*+>|(?=<body)|\Z)",
    re.DOTALL | re.IGNORECASE,
)
_BLOCK_TAG = re.compile(r"</?(?:p|br|li|tr|d[dt]|div|h[1-6]|table|pre)\b[^<>]*+>?", re.IGNORECASE)
# Without something in its place, numbers of two cells, or a number and its power, would be another number.
_CELL, _POWER = (re.compile(rf"<{tag}\b[^<>]*+>?", re.IGNORECASE) for tag in ("t[dh]", "sup"))
_TAG = re.compile(r"</?[a-z!?][^<>]*+>?", re.IGNORECASE)
_ENTITY = re.compile(r"&#?\w{1,32};?")
_HEADING = re.compile(r"(#{1,6}\s|=+\s|\d+(\.\d+)*\s+[A-Z])")
_SHOWN_NAMES = 60
_LONGEST_NAME = 200


@dataclass(frozen=True, slots=True)
class Readable:
    """What a file contains: the ways to tell it, by name, and what it says of signals."""

    forms: tuple[tuple[str, str], ...]  # the fullest first; the last one is always short
    found: tuple[Threshold, ...] = ()  # in what the requirement depends on


def of_diagram(diagram: Diagram, seeds: Collection[str]) -> Readable:
    """Return the forms of a Simulink file: its structure before a requirement's signals, or names."""
    only = upstream(diagram, seeds)
    whole = "structure" if only is None else "structure, as far as the requirement depends on it"
    forms = (
        (whole, structure_text(diagram, only)),
        ("names only", names_text(diagram)),
        ("name only", shortened(diagram.name, _LONGEST_NAME)),
    )
    return Readable(forms, (*_modes(diagram), *diagram_thresholds(diagram, only)))


def of_source(
    source: Source, library: Sequence[Source], seeds: Collection[str], *, is_named: bool = True
) -> Readable:
    """Return the forms of a source; constants of one may be declared in another one of the library.

    A source that the user did not name is told only if it sets one of the requirement's signals, ``seeds``.
    """
    short = ("size only", counted(len(source.text.splitlines()), "line"))
    variables = {each.name for each in source.assigned if not each.is_constant}
    if not is_named and variables.isdisjoint(name.rpartition(".")[2] for name in seeds):
        return Readable((short,))
    constants = constants_of(source, library)
    is_dotted = source.is_modelica
    limits = tuple(thresholds(source.text, constants, source.shown, is_dotted=is_dotted, has_lines=True))
    compared = [f"{t.text}  [{t.place}]" for t in limits]
    declared = dict.fromkeys(each.name for each in source.assigned if each.is_constant)
    stated = [f"{name} = {constants[name]}" for name in declared if constants.get(name)]
    whole = without_annotations(source.text) if source.is_modelica else source.text
    forms = (
        ("whole", whole.strip()),
        ("parameters and comparisons", "\n".join([*stated, *compared])),
        ("lines with the requirement's signals", "\n".join(_naming(source.text, "\n", seeds))),
        short,
    )
    return Readable(tuple(form for form in forms if form[1]), limits)


def of_text(text: str, shown: str, signals: Collection[str]) -> Readable:
    """Return the forms of a document, of HTML without its tags; ``signals`` are all those of the model."""
    if PurePosixPath(shown).suffix.lower() in _HTML:
        text = _without_tags(text)
    lines = [line.rstrip() for line in text.splitlines()]
    headings = [line for line in lines if _HEADING.match(line)]
    known = [name for name in signals if len(name) > 1]
    named = list(_naming(text, r"\n\s*\n", known))
    forms = (
        ("whole", "\n".join(lines).strip()),
        ("headings, and paragraphs that name a signal", "\n".join([*headings, "", *named]).strip()),
        ("paragraphs that name a signal", "\n".join(named)),
        # Tables and logs are one paragraph.
        ("lines that name a signal", "\n".join(_naming(text, "\n", known))),
        ("headings", "\n".join(headings)),
        ("size only", counted(len(lines), "line")),
    )
    return Readable(tuple(form for form in forms if form[1]))


def _naming(text: str, end: str, signals: Collection[str]) -> Iterator[str]:
    """Return the pieces of a text that name a signal, by the pattern between pieces."""
    names = {name.rpartition(".")[2] for name in signals}
    words = {name for name in names if name.isidentifier()}
    others = names - words
    for piece in re.split(end, text):
        if not words.isdisjoint(re.findall(r"\w+", piece)) or any(name in piece for name in others):
            yield " ".join(piece.split())


def _modes(diagram: Diagram) -> Iterator[Threshold]:
    """Return the outputs of charts with the states between which the chart switches."""
    for chart in diagram.charts:
        states = [state.name for state in chart.states]
        for data in chart.data:
            if data.scope == "output" and states:
                more = f", ... ({len(states)})" if len(states) > _SHOWN_NAMES else ""
                listed = ", ".join(shortened(name, _LONGEST_NAME) for name in states[:_SHOWN_NAMES])
                text = f"set by the chart {chart.name} with the states {listed}{more}"
                yield Threshold(frozenset([data.name]), text, (), "")


def _without_tags(page: str) -> str:
    for pattern, shown in ((_HIDDEN, ""), (_BLOCK_TAG, "\n"), (_CELL, " "), (_POWER, "^"), (_TAG, "")):
        page = pattern.sub(shown, page)
    plain = _ENTITY.sub(lambda entity: html.unescape(entity[0]), re.sub(r"[ \t\r\f]+", " ", page))
    return re.sub(r"\n{3,}", "\n\n", plain)
