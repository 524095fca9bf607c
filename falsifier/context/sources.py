"""Modelica and C sources: their constants, and what they compare with these.

Nothing is resolved that a compiler would resolve: names are taken as they are, whichever class or function
they belong to, and both branches of ``#if`` count.
"""

import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from falsifier.context.structures import Structures, fields_of, read_structures
from falsifier.context.thresholds import (
    CLOSING,
    OPENING,
    Threshold,
    Token,
    at_breakpoints,
    number_in,
    statements,
    thresholds,
    tokens_of,
)

# Patterns take what they have looked at, so that time grows with the length of a file.
_DEFINE = re.compile(r"\s*#\s*define\s+(\w+)[ \t]+(.*)", re.DOTALL)
_COMMENT = re.compile(r"//[^\n]*+|/\*.*?(?:\*/|\Z)", re.DOTALL)
_UNCHANGING = frozenset(("parameter", "constant", "const"))
_ROW = re.compile(r"(?:^\s*\[|;)\s*([-+]?[\d.]++(?:[eE][-+]?\d++)?)")
_WORD = re.compile(r"\{(\w+)\}|\b[a-zA-Z]\w*\b")
_MAX_CHARACTERS = 4_000_000  # far more than a model of 10,000 lines has
_MAX_VALUE = 400  # characters of a value
_CONNECT = re.compile(r"connect\s*+\(([^,();]*+),([^,();]*+)\)")
# Comparisons of blocks of Modelica's standard library, by their type's name; names in braces are inputs,
# other names parameters.
_COMPARING: Mapping[str, tuple[str, ...]] = {
    "DeadZone": ("{u} > uMax", "{u} < uMin"),
    "Greater": ("{u1} > {u2}",),
    "GreaterEqual": ("{u1} >= {u2}",),
    "GreaterEqualThreshold": ("{u} >= threshold",),
    "GreaterThreshold": ("{u} > threshold",),
    "Hysteresis": ("{u} > uHigh", "{u} < uLow"),
    "Less": ("{u1} < {u2}",),
    "LessEqual": ("{u1} <= {u2}",),
    "LessEqualThreshold": ("{u} <= threshold",),
    "LessThreshold": ("{u} < threshold",),
    "Limiter": ("{u} > uMax", "{u} < uMin"),
    "OnOffController": ("{u} > {reference} + bandwidth / 2", "{u} < {reference} - bandwidth / 2"),
    "ZeroCrossing": ("{u} > 0",),
}
_TABLES = ("CombiTable1D", "CombiTable1Ds", "CombiTable1Dv")
# What the library gives to parameters.
_DEFAULTS = {"uLow": "0", "uHigh": "1", "threshold": "0", "bandwidth": "0.1"}


@dataclass(frozen=True, slots=True)
class _Assigned:
    """A value that a statement gives to a name.

    Attributes:
        name: what is set: of ``a.b`` this path in Modelica, and ``b`` in C.
        value: as written, in one line; empty if it is longer than a value of interest.
        is_inner: whether it stands within brackets, as modifiers of Modelica do.
        is_constant: whether the statement declares constants.
    """

    name: str
    value: str
    is_inner: bool
    is_constant: bool


@dataclass(frozen=True, slots=True)
class _Block:
    """A block of Modelica's standard library that is declared: type, name, values of parameters and line."""

    kind: str
    name: str
    parameters: Mapping[str, str]
    line: int


@dataclass(slots=True)
class Source:
    """One file.

    Attributes:
        text: its text.
        shown: what messages call it.
        is_modelica: whether it is Modelica, and not C.
        constants: values of macros, constants and parameters.
        modified: values that modifiers such as ``Base(limit = 8)`` give to names.
        leading: what Modelica connects or equates with members of components, such as ``limiter.u``.
        blocks: what it declares of blocks that compare.
        structures: what it declares of structures of C, and with which values.
        names_set: names to which it gives a value.
    """

    text: str
    shown: str
    is_modelica: bool
    constants: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    modified: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    leading: dict[str, str] = field(default_factory=dict)
    blocks: list[_Block] = field(default_factory=list)
    structures: Structures = field(default_factory=Structures)
    names_set: set[str] = field(default_factory=set)


def read_source(text: str, shown: str, *, is_modelica: bool) -> Source | None:
    """Return what a file says; None if it is too long to be read."""
    if len(text) > _MAX_CHARACTERS:
        return None
    found = Source(text, shown, is_modelica)
    line, at = 1, 0
    for tokens in statements(text):
        if not tokens:
            continue
        line, at = line + text.count("\n", at, tokens[0].start), tokens[0].start
        for directive in (t for t in tokens if t.kind == "directive"):
            if defined := _DEFINE.match(_COMMENT.sub(" ", directive.text)):
                found.constants[defined[1]].append(_one_line(defined[2].replace("\\\n", " ")))
        for each in _assignments(text, tokens, is_modelica=is_modelica):
            if each.is_inner:
                found.modified[each.name].append(each.value)
            elif each.is_constant:
                found.constants[each.name].append(each.value)
            else:
                found.names_set.add(each.name)
                found.leading[each.name] = each.value
        if is_modelica:
            _read_blocks(found, tokens, line)
    if not is_modelica:
        found.structures = read_structures(_COMMENT.sub(" ", text))
    return found


def roots_of(names: Collection[str]) -> set[str]:
    """Names under which a source may set signals: those of components or members, and the last ones."""
    return {part for name in names for part in (name.partition(".")[0], name.rpartition(".")[2])}


def constants_of(source: Source, library: Sequence[Source], signals: Collection[str]) -> dict[str, str]:
    """Return values of the constants that a file may use; ``5 or 9`` if there are two.

    Args:
        source: the file.
        library: all files of its language: each may define constants of another one.
        signals: signals of the model, which are no constants although a structure may give their first value.
    """
    files = [source, *(each for each in library if each is not source)]
    found: dict[str, list[str]] = defaultdict(list)
    for each in files:
        for name, values in each.constants.items():
            found[name] += values
    if source.is_modelica:  # which modifier holds is not told apart
        for each in files:
            for name in found.keys() & each.modified.keys():
                found[name] += each.modified[name]
    else:
        for name, value in fields_of([each.structures for each in files]):
            found[name].append(value)
        for name in {name.rpartition(".")[2] for name in signals}.union(*(f.names_set for f in files)):
            found.pop(name, None)
    return {name: " or ".join(dict.fromkeys(filter(None, values))) for name, values in found.items()}


def comparisons(source: Source, constants: Mapping[str, str]) -> Iterator[Threshold]:
    """Return what a file compares with constants."""
    is_dotted = source.is_modelica
    yield from thresholds(source.text, constants, source.shown, is_dotted=is_dotted, has_lines=True)
    for block in source.blocks:
        place = f"{source.shown}:{block.line}"
        for text in _COMPARING.get(block.kind, ()):
            told = _filled(text, block, source.leading)
            yield from thresholds(told, constants, place, is_dotted=True)
        ports = (f"{block.name}.u", f"{block.name}.u[1]")
        fed = next((source.leading[port] for port in ports if port in source.leading), "")
        if block.kind in _TABLES and fed:
            stated = block.parameters.get("table", "")
            rows = [row for row in _ROW.findall(constants.get(stated, stated)) if number_in(row) is not None]
            if rows:
                yield at_breakpoints(fed, rows, place)


def without_annotations(text: str) -> str:
    """Return Modelica as written, without its annotations."""
    told, end = "", 0
    tokens = list(tokens_of(text)) if "annotation" in text else []
    closing = _closing(tokens)
    for i, token in enumerate(tokens[:-1]):
        if token.text == "annotation" and tokens[i + 1].text == "(" and token.start >= end:
            told += text[end : token.start].rstrip()
            end = tokens[closing[i + 1]].end
    return told + text[end:]


def _assignments(text: str, tokens: Sequence[Token], *, is_modelica: bool) -> Iterator[_Assigned]:
    """Return what a statement sets, equates, declares with a value or modifies."""
    begins: dict[int, int] = {}  # of brackets, by where they end
    opened: list[int] = []
    is_constant = False
    for i, token in enumerate(tokens):
        is_block = token.text in "{}" and not is_modelica
        if is_block:
            is_constant = False
        elif token.text in _UNCHANGING and not opened:
            is_constant = True
        elif token.text in OPENING:
            opened.append(i)
        elif token.text in CLOSING and opened:
            begins[i] = opened.pop()
        elif token.text == "annotation":
            return
        elif token.text in ("=", ":="):
            last = begins.get(i - 1, i) - 1  # before indices and modifiers
            if last < 0 or tokens[last].kind != "name":
                continue
            if not is_modelica and _is_label(tokens, last):
                continue
            first = last
            while is_modelica and first > 1 and tokens[first - 1].text == ".":
                first -= 2
            if tokens[last].text == "der" and last + 2 < i:
                first = last = last + 2
            end = tokens[i - 1].end if tokens[i - 1].text == "]" and is_modelica else tokens[last].end
            name = text[tokens[first].start : end].strip("'")
            yield _Assigned(name, _value(text, tokens, i), bool(opened), is_constant)


def _is_label(tokens: Sequence[Token], name: int) -> bool:
    """Whether a name is a field that is filled, as in ``{ .limit = 8 }``."""
    return name > 1 and tokens[name - 1].text == "." and tokens[name - 2].text in ("{", ",")


def _value(text: str, tokens: Sequence[Token], sign: int) -> str:
    """Return what stands behind an equals sign; empty if it is long."""
    depth, end = 0, sign + 1
    while end < len(tokens) and tokens[end].end - tokens[sign].end <= _MAX_VALUE:
        word = tokens[end].text
        is_end = (
            word in CLOSING or word in (",", ";", "annotation") or tokens[end].kind in ("text", "directive")
        )
        if depth == 0 and is_end:
            return _one_line(_COMMENT.sub(" ", text[tokens[sign].end : tokens[end].start]))
        depth += (word in OPENING) - (word in CLOSING)
        end += 1
    return ""


def _read_blocks(found: Source, tokens: Sequence[Token], line: int) -> None:
    """Note the blocks of the standard library that a statement declares, and what it connects."""
    closing = _closing(tokens)
    end = 0  # of the block that was read last: a block within it is no component
    for i, (kind, name) in enumerate(pairwise(tokens)):
        if kind.text == "connect":
            if sides := _CONNECT.match(found.text, kind.start):
                one, other = sides[1].strip(), sides[2].strip()
                found.leading |= {one: other, other: one}
        elif i >= end and name.kind == "name" and (kind.text in _COMPARING or kind.text in _TABLES):
            end = closing.get(i + 2, i + 1)
            inner = tokens[i + 3 : end + 1]
            stated = _assignments(found.text, inner, is_modelica=True)
            direct = {each.name: each.value for each in stated if not each.is_inner}
            found.blocks.append(_Block(kind.text, name.text, direct, line))


def _closing(tokens: Sequence[Token]) -> dict[int, int]:
    """Return where each bracket ends; those that are not closed end with the tokens."""
    found: dict[int, int] = {}
    opened: list[int] = []
    for i, token in enumerate(tokens):
        if token.text in OPENING:
            opened.append(i)
        elif token.text in CLOSING and opened:
            found[opened.pop()] = i
    return found | dict.fromkeys(opened, len(tokens) - 1)


def _filled(text: str, block: _Block, leading: Mapping[str, str]) -> str:
    """Return a comparison with a block's parameters, and what leads to its inputs."""
    given = block.parameters
    stated = {"uMin": f"-({given.get('uMax', 'uMax')})", **_DEFAULTS, **given}

    def value(word: re.Match[str]) -> str:
        port = word[1]
        if port is None:
            return stated.get(word[0], word[0])
        return leading.get(f"{block.name}.{port}") or given.get(port) or f"{block.name}.{port}"

    return _WORD.sub(value, text)


def _one_line(text: str) -> str:
    return " ".join(text.split())
