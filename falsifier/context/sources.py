"""Modelica and C sources: the values of their constants.

Nothing is resolved that a compiler would resolve: names are taken as they are, whichever class, function or
structure they belong to, and both branches of ``#if`` count.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import NamedTuple

from falsifier.context.thresholds import CLOSING, OPENING, SourceToken, statements, tokens_of

# Patterns take what they have looked at, so that time grows with the length of a file.
_DEFINE = re.compile(r"\s*#\s*define\s+(\w+)[ \t]+(.*)", re.DOTALL)
_COMMENT = re.compile(r"//[^\n]*+|/\*.*?(?:\*/|\Z)", re.DOTALL)
_C, _MODELICA = (".c", ".h", ".cpp", ".hpp"), (".mo",)
_UNCHANGING = frozenset(("parameter", "constant", "const", "constexpr"))
_MAX_CHARACTERS = 4_000_000  # far more than a model of 10,000 lines has
_MAX_VALUE = 400  # characters of a value


class Assigned(NamedTuple):
    """A value that a file gives to a name: of ``a.b`` or ``a->b`` to its last part."""

    name: str  # what is set, equated, declared with a value, modified or defined
    value: str  # as written; empty if it is long
    # Whether it declares a macro, constant or parameter. What does not, may in Modelica modify one:
    # ``Base(limit = 8)``.
    is_constant: bool


@dataclass(frozen=True, slots=True)
class Source:
    """One file: its text, what messages call it, its language (Modelica or C), and what it sets."""

    text: str
    shown: str
    is_modelica: bool
    assigned: tuple[Assigned, ...]


def read_source(text: str, shown: str) -> Source | None:
    """Return what a source says, by the ending of its name; None if it is no source, or too long."""
    suffix = PurePosixPath(shown).suffix.lower()
    if suffix not in (*_MODELICA, *_C) or len(text) > _MAX_CHARACTERS:
        return None
    is_modelica = suffix in _MODELICA
    found = (a for tokens in statements(text) for a in _assignments(text, tokens, is_modelica=is_modelica))
    return Source(text, shown, is_modelica, tuple(found))


def constants_of(source: Source, library: Sequence[Source]) -> dict[str, str]:
    """Return values of the constants that a file may use; ``5 or 9`` if there are several.

    Other files of the same language may define its constants, or change them.
    """
    alike = [each for each in library if each.is_modelica == source.is_modelica and each is not source]
    assigned = [each for file in (source, *alike) for each in file.assigned]
    found: dict[str, list[str]] = {each.name: [] for each in assigned if each.is_constant}
    for name, value, is_constant in sorted(assigned, key=lambda each: not each.is_constant):
        if is_constant or source.is_modelica:  # which modifier holds is not told apart
            found.get(name, []).append(value)
        else:  # a variable of the same name
            found.pop(name, None)
    return {name: " or ".join(dict.fromkeys(filter(None, values))) for name, values in found.items()}


def without_annotations(text: str) -> str:
    """Return Modelica as written, without its annotations."""
    told, end, depth = "", 0, 0
    begun: int | None = None  # where the annotation begins that is being read
    for token in tokens_of(text) if "annotation" in text else ():
        if begun is not None:
            depth += (token.text in OPENING) - (token.text in CLOSING)
            if not depth:
                told, end, begun = told + text[end:begun].rstrip(), token.end, None
        elif token.text == "annotation":
            begun = token.start
    return told + (text[end:] if begun is None else text[end:begun].rstrip())


def _assignments(text: str, tokens: Sequence[SourceToken], *, is_modelica: bool) -> Iterator[Assigned]:
    begins: dict[int, int] = {}  # of brackets, by where they end
    opened: list[int] = []
    is_constant = False
    for i, token in enumerate(tokens):
        if token.text in "{}" and not is_modelica:
            is_constant = False
        elif token.text in _UNCHANGING and not opened:
            is_constant = True
        elif token.text in OPENING:
            opened.append(i)
        elif token.text in CLOSING and opened:
            begins[i] = opened.pop()
        elif token.text == "annotation":
            return
        elif token.kind == "directive":
            if defined := _DEFINE.match(_COMMENT.sub(" ", token.text)):
                yield Assigned(defined[1], _stated(defined[2]), is_constant=True)
        elif token.text in ("=", ":="):
            last = begins.get(i - 1, i) - 1  # before indices and modifiers
            if last >= 0 and tokens[last].text == "der" and last + 2 < i:
                last += 2
            if last >= 0 and tokens[last].kind == "name":
                value = _stated(_value(text, tokens, i))
                yield Assigned(tokens[last].text.strip("'"), value, is_constant and not opened)


def _stated(value: str) -> str:
    """Return a value in one line, without comments."""
    return " ".join(_COMMENT.sub(" ", value.replace("\\\n", " ")).split())


def _value(text: str, tokens: Sequence[SourceToken], sign: int) -> str:
    """Return what stands behind an equals sign; empty if it is long."""
    depth = 0
    for token in tokens[sign + 1 : sign + 2 + _MAX_VALUE]:
        if token.end - tokens[sign].end > _MAX_VALUE:
            break
        is_end = token.text in CLOSING or token.text in (",", ";", "annotation")
        if depth == 0 and (is_end or token.kind in ("text", "directive")):
            return text[tokens[sign].end : token.start]
        depth += (token.text in OPENING) - (token.text in CLOSING)
    return ""
