"""What may be told of a file: several forms of it, the fullest first, and thresholds found in it."""

import html
import json
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import PurePosixPath
from types import MappingProxyType

from falsifier.context import modelica
from falsifier.context.levels import Definitions
from falsifier.context.simulink import Diagram, names_text, structure_text
from falsifier.context.simulink.diagram import upstream
from falsifier.context.simulink.expressions import definitions, diagram_thresholds
from falsifier.context.sources import Source, constants_of, read_source
from falsifier.context.statements import Statement, assignments, lines_told, reached
from falsifier.context.thresholds import Threshold, thresholds, within
from falsifier.core.words import counted
from falsifier.errors import SpecError

C_SUFFIXES = (".c", ".h", ".cpp", ".hpp")
MODELICA_SUFFIXES = (".mo",)
HTML_SUFFIXES = (".html", ".htm", ".xhtml")
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
_MEMBER = re.compile(r"(?:->|\.)\s*(\w+)")
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
    """Return what a source says, by the ending of its name; None if it is no source.

    Raises:
        SpecError: if it is too long.
    """
    suffix = PurePosixPath(shown).suffix.lower()
    if suffix not in (*MODELICA_SUFFIXES, *C_SUFFIXES):
        return None
    return read_source(text, shown, is_modelica=suffix in MODELICA_SUFFIXES)


def of_source(
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
        is_named: whether the user named this file; others are told only as far as they concern the signals.
        library: what all sources that were named say, by their text: a Modelica class may extend or use
            others, C files may define each other's structures and macros.

    A source that is too long is told as text, and its form says so.
    """
    try:
        source = library.get(text) or parsed(text, shown)
    except SpecError as error:
        found = _not_understood(text, f"not understood: {str(error).removeprefix(f'{shown}: ')}", signals)
        return found if is_named else Readable(found.forms[-1:])
    if source is not None:
        others = [s for s in library.values() if s.is_modelica == source.is_modelica] or [source]
        if source.is_modelica:
            return _of_modelica(source, others, seeds, signals)
        return _of_c(source, others, seeds, signals, is_named=is_named)
    suffix = PurePosixPath(shown).suffix.lower()
    if suffix in HTML_SUFFIXES:
        return _of_document(_without_tags(text), signals)
    if suffix == ".json":
        return _of_json(text, signals)
    return _of_document(text, signals)


def _of_modelica(
    source: Source,
    library: Sequence[Source],
    seeds: Collection[str],
    signals: Collection[str],
) -> Readable:
    shown = source.shown
    main = modelica.class_for(source, library, _roots((*seeds, *signals)))
    if not main:
        return _not_understood(source.text, "no class declares a signal of the model", signals)
    files: dict[str, Source] = {}  # of the same name, the class of the file itself counts
    by_class: dict[str, list[Statement]] = {}
    for each in (*(s for s in library if s is not source), source):
        for name, found in groupby(sorted(each.statements, key=lambda s: s.scope), key=lambda s: s.scope):
            files[name], by_class[name] = each, list(found)
    declared = {n: c for name in main for n, c in files[name].components[name].items()}
    leading = {port: text for name in main for port, text in files[name].leading[name].items()}
    statements = [s for name in main for s in by_class[name]]
    roots = _roots(seeds) & declared.keys()
    names, kept = reached(statements, roots, ()) if roots else (set(declared), set(statements))
    types = {declared[n].kind.rpartition(".")[2] for n in names & declared.keys()}
    others = modelica.used_classes(names | types, main, library)
    constants = _constants(main, files, library)
    compared = [(s.text, s.line) for s in statements if s in kept and s.is_told]
    compared += modelica.comparisons(declared, leading, names)
    limits = [*thresholds(compared, constants, shown, is_dotted=True)]
    limits += modelica.tables(declared, leading, names, constants, shown)
    for name in others:  # its variables are not the signals of the same name
        texts = ((s.text, s.line) for s in by_class[name] if s.is_told)
        inner = thresholds(texts, _constants([name], files, library), shown, is_dotted=True)
        limits += [within(threshold, dict.fromkeys(threshold.names, "")) for threshold in inner]
    form = "what the requirement depends on" if roots else f"class {main[0]}"
    used = {n: v for n, v in constants.items() if n in names}

    def told(*, whole: bool) -> str:
        lines = [line for name in main for line in lines_told(by_class[name], kept)]
        more = [line for name in others for line in lines_told(by_class[name], None)] if whole else []
        return "\n".join([*lines, *_left_out(statements, kept, "//"), *more])

    forms = (
        Form(form, lambda: told(whole=True)),
        Form(f"{form}, without other classes", lambda: told(whole=False)),
        Form("parameters and comparisons", lambda: _parameters(used, limits)),
        Form("comparisons", lambda: _parameters({}, limits)),
        Form("name only", lambda: _short(f"class {main[0]}")),
    )
    equal, fed = assignments(statements)
    made = dict(modelica.outputs(declared, leading))
    known = Definitions({**made, **leading, **equal}, fed)
    return Readable(forms, tuple(limits), known=known)


def _left_out(statements: Iterable[Statement], kept: Collection[Statement], comment: str) -> Iterator[str]:
    left = sum(s.is_told and s not in kept for s in statements)
    if left:
        yield f"{comment} {counted(left, 'statement')} left out: not met from the requirement's signals on"


def _constants(main: Iterable[str], files: Mapping[str, Source], library: Iterable[Source]) -> dict[str, str]:
    """Return values of parameters with those that modifiers give them: which holds is not told apart."""
    found = {n: dict.fromkeys(v) for name in main for n, v in files[name].constants[name].items()}
    for source in library:
        for name in found.keys() & source.modified.keys():
            found[name] |= dict.fromkeys(source.modified[name])
    return {name: " or ".join(values) for name, values in found.items()}


def _roots(names: Collection[str]) -> set[str]:
    """Names under which a source may declare signals: those of components or members, and the last ones."""
    return {part for name in names for part in (name.partition(".")[0], name.rpartition(".")[2])}


def _of_c(
    source: Source,
    library: Sequence[Source],
    seeds: Collection[str],
    signals: Collection[str],
    *,
    is_named: bool,
) -> Readable:
    constants = constants_of(library, signals)
    functions = [s.text for s in source.statements if s.scope and s.outer is None and not s.follows]
    statements = source.statements
    roots = {name.rpartition(".")[2] for name in seeds} & {name for s in statements for name in s.sets}
    names, kept = reached(statements, roots, {s.scope for s in statements})
    relevant = [s for s in statements if s in kept] if roots else statements
    limits = [
        _of_function(limit, source.own.get(scope, set()))
        for scope, found in groupby(relevant, key=lambda s: s.scope)
        for limit in thresholds(((s.text, s.line) for s in found), constants, source.shown)
    ]
    limits = list({limit.text: limit for limit in reversed(limits)}.values())[::-1]
    known = Definitions(*assignments(statements))
    size = Form("size only", lambda: counted(len(functions), "function"))
    if not roots:
        whole = (
            Form("whole, since no function sets a signal of the requirement", source.text.strip),
            Form("functions", lambda: "\n".join(functions[:_SHOWN_NAMES])),
            size,
        )
        return Readable(whole, tuple(limits), known=known) if is_named else Readable(whole[2:])
    used = {name: value for name, value in constants.items() if name in names}
    forms = (
        Form(
            "what the requirement depends on",
            lambda: "\n".join([*lines_told(statements, kept), *_left_out(statements, kept, "//")]),
        ),
        Form("constants and comparisons", lambda: _parameters(used, limits)),
        Form("comparisons", lambda: _parameters({}, limits)),
        size,
    )
    return Readable(forms, tuple(limits), known=known)


def _of_function(limit: Threshold, own: Collection[str]) -> Threshold:
    """Return a comparison as it is seen from outside a function that declares some variables."""
    inner = limit.names.intersection(own).difference(_MEMBER.findall(limit.text))
    return within(limit, dict.fromkeys(inner, ""))


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
        Form("whole", lambda: json.dumps(content, indent=1) if len(text) <= _LONGEST_WHOLE else text),
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
    names = {name.rpartition(".")[2] for name in signals if len(name) > 1}
    words = {name for name in names if name.isidentifier()}
    others = names - words
    for paragraph in re.split(r"\n\s*\n", text):
        if not words.isdisjoint(re.findall(r"\w+", paragraph)) or any(name in paragraph for name in others):
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
