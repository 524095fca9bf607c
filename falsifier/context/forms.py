"""What may be told of a file: several forms of it, the fullest first, and thresholds found in it."""

import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser
from pathlib import PurePosixPath

from falsifier.context.c_source import CSource, c_conditions, c_slice, c_text, read_c
from falsifier.context.levels import Definitions
from falsifier.context.modelica import (
    ModelicaClass,
    class_for,
    class_text,
    conditions,
    modified_values,
    read_modelica,
    slice_of,
    used_classes,
    with_bases,
)
from falsifier.context.simulink import Diagram, names_text, structure_text
from falsifier.context.simulink.conditions import chart_names, comparisons, constants
from falsifier.context.simulink.definitions import definitions
from falsifier.context.simulink.upstream import upstream
from falsifier.context.statements import Slice, Statement, assignments
from falsifier.context.thresholds import Threshold, thresholds, within
from falsifier.core.words import counted
from falsifier.errors import SpecError

C_SUFFIXES = (".c", ".h", ".cpp", ".hpp")
MODELICA_SUFFIXES = (".mo",)
HTML_SUFFIXES = (".html", ".htm", ".xhtml")
_SKIPPED_TAGS = ("script", "style", "head")
_BLOCK_TAGS = ("p", "br", "li", "tr", "div", "h1", "h2", "h3", "h4", "h5", "h6", "table", "pre")
_HEADING = re.compile(r"(#{1,6}\s|=+\s|\d+(\.\d+)*\s+[A-Z])")
_SHOWN_NAMES = 60
_LONGEST_NAME = 200


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
    found = [
        within(threshold, chart_names(diagram, place))
        for text, place in comparisons(diagram, only)
        for threshold in thresholds([(text, 0)], constants(diagram, place), f"{diagram.name}/{place}")
    ]
    whole = "structure" if only is None else "structure, as far as the requirement depends on it"
    forms = (
        Form(whole, lambda: structure_text(diagram, only)),
        Form("names only", lambda: names_text(diagram)),
        Form("name only", lambda: _short(diagram.name)),
    )
    return Readable(forms, tuple(found), tuple(_modes(diagram)), Definitions(definitions(diagram)))


def of_source(
    text: str,
    shown: str,
    seeds: Collection[str],
    signals: Collection[str],
    *,
    is_named: bool = True,
    library: Sequence[ModelicaClass] = (),
) -> Readable:
    """Return the forms of a text file, by the ending of its name.

    Args:
        text: its content.
        shown: its path.
        seeds: the requirement's signals.
        signals: all signals of the model.
        is_named: whether the user named this file; others are told only as far as they concern the signals.
        library: classes of all Modelica files that were named, which a class in this one may extend or use.

    A source that is not understood is told as text, and its form says so.
    """
    suffix = PurePosixPath(shown).suffix.lower()
    try:
        if suffix in MODELICA_SUFFIXES:
            return _of_modelica(text, shown, seeds, signals, library)
        if suffix in C_SUFFIXES:
            return _of_c(text, shown, seeds, is_named=is_named)
    except SpecError as error:
        found = _not_understood(text, f"not understood: {str(error).removeprefix(f'{shown}: ')}", signals)
        return found if is_named else Readable(found.forms[-1:])
    if suffix in HTML_SUFFIXES:
        return _of_document(_without_tags(text), signals)
    if suffix == ".json":
        return _of_json(text, signals)
    return _of_document(text, signals)


def _of_modelica(
    text: str,
    shown: str,
    seeds: Collection[str],
    signals: Collection[str],
    library: Sequence[ModelicaClass],
) -> Readable:
    own = read_modelica(text, shown)
    classes = (*library, *own)  # of the same name, those of the file itself count
    found = class_for((with_bases(each, classes) for each in own), _roots((*seeds, *signals)))
    if found is None:
        return _not_understood(text, "no class declares a signal of the model", signals)
    roots = _roots(seeds) & found.names
    kept = slice_of(found, roots) if roots else None
    others = used_classes(found, kept, classes)
    changed = modified_values(text, shown)
    limits = list(thresholds(conditions(found, kept), _possible(found.constants, changed), shown))
    for other in others:  # its variables are not the signals of the same name
        inner = thresholds(conditions(other, None), _possible(other.constants, changed), shown)
        limits += [within(threshold, dict.fromkeys(threshold.names, "")) for threshold in inner]
    of_main = class_text(found, kept)
    stated = {n: v for n, v in found.constants.items() if kept is None or n in kept.names}
    form = "what the requirement depends on" if roots else f"class {found.name}"
    forms = (
        Form(form, lambda: "\n".join([of_main, *(class_text(other, None) for other in others)])),
        Form(f"{form}, without other classes", lambda: of_main),
        Form("parameters and comparisons", lambda: _parameters(stated, limits)),
        Form("comparisons", lambda: _parameters({}, limits)),
        Form("name only", lambda: _short(f"{found.kind} {found.name}")),
    )
    known = _known(found.statements)
    declared = {d.name: d.value for d in found.declarations if d.value and d.name not in found.constants}
    return Readable(forms, tuple(limits), known=replace(known, equal={**declared, **known.equal}))


def _known(statements: Collection[Statement]) -> Definitions:
    return Definitions(*assignments(statements))


def _possible(constants: Mapping[str, str], changed: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Return values of parameters with those that modifiers give them: which holds is not told apart."""
    return {n: " or ".join(dict.fromkeys((v, *changed.get(n, ())))) for n, v in constants.items()}


def _roots(names: Collection[str]) -> set[str]:
    """Names under which a source may declare signals: those of components or members, and the last ones."""
    return {part for name in names for part in (name.partition(".")[0], name.rpartition(".")[2])}


def _of_c(text: str, shown: str, seeds: Collection[str], *, is_named: bool) -> Readable:
    found = read_c(text, shown)
    roots = {name.rpartition(".")[2] for name in seeds} & found.names
    if not roots:
        functions = [f.head for f in found.functions]
        limits = _c_limits(found, None, shown)
        whole = (
            Form("whole, since no function sets a signal of the requirement", lambda: c_text(found, None)),
            Form("functions", lambda: "\n".join(functions[:_SHOWN_NAMES])),
            Form("size only", lambda: counted(len(functions), "function")),
        )
        known = _known(found.statements)
        return Readable(whole, tuple(limits), known=known) if is_named else Readable(whole[2:])
    kept = c_slice(found, roots)
    limits = _c_limits(found, kept, shown)
    used = {name: value for name, value in found.constants.items() if name in kept.names}
    forms = (
        Form("what the requirement depends on", lambda: c_text(found, kept)),
        Form("constants and comparisons", lambda: _parameters(used, limits)),
        Form("comparisons", lambda: _parameters({}, limits)),
        Form("size only", lambda: counted(len(found.functions), "function")),
    )
    return Readable(forms, tuple(limits), known=_known(found.statements))


def _c_limits(found: CSource, kept: Slice | None, shown: str) -> list[Threshold]:
    own = found.own
    limits = thresholds(c_conditions(found, kept), found.constants, shown)
    return [
        within(limit, {n: "" for n in limit.names & own if not re.search(rf"(->|\.)\s*{n}\b", limit.text)})
        for limit in limits
    ]


def _of_document(text: str, signals: Collection[str]) -> Readable:
    lines = [line.rstrip() for line in text.splitlines()]
    headings = [line for line in lines if _HEADING.match(line)]
    named = list(_naming(text, signals))
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
        Form("whole", lambda: json.dumps(content, indent=1)),
        Form("keys", lambda: ", ".join(map(str, keys))),
        Form("size only", lambda: counted(len(keys), "key")),
    )
    return Readable(forms)


def _not_understood(text: str, why: str, signals: Collection[str]) -> Readable:
    inner = _of_document(text, signals)
    return Readable(tuple(Form(f"{form.name}; {why}", form.text) for form in inner.forms))


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}... ({len(name):,} characters)"


def _parameters(values: Mapping[str, str], limits: Sequence[Threshold]) -> str:
    stated = [f"{name} = {value}" for name, value in values.items()]
    return "\n".join([*stated, *(f"{t.text}  [{t.place}]" for t in limits)])


def _naming(text: str, signals: Collection[str]) -> Iterator[str]:
    """Return the paragraphs of a document that name a signal."""
    names = [re.escape(name.rpartition(".")[2]) for name in signals if len(name) > 1]
    if not names:
        return
    pattern = re.compile(rf"\b({'|'.join(names)})\b")
    for paragraph in re.split(r"\n\s*\n", text):
        if pattern.search(paragraph):
            yield " ".join(paragraph.split())


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
    parser = _Text()
    parser.feed(text)
    parser.close()
    return re.sub(r"\n{3,}", "\n\n", "".join(parser.found))


class _Text(HTMLParser):
    """Keeps the text of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self._skipped = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._skipped = 0 if tag == "body" else self._skipped + (tag in _SKIPPED_TAGS)  # a head may stay open
        if tag in _BLOCK_TAGS:
            self.found.append("\n")

    def handle_endtag(self, tag: str) -> None:
        self._skipped -= tag in _SKIPPED_TAGS and self._skipped > 0
        if tag in _BLOCK_TAGS:
            self.found.append("\n")

    def handle_data(self, data: str) -> None:
        if not self._skipped:
            self.found.append(re.sub(r"[ \t\r\f]+", " ", data))
