"""Modelica and C sources: the values of their constants.

Nothing is resolved that a compiler would resolve: names are taken as they are, whichever class, function or
structure they belong to, and both branches of ``#if`` count.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from falsifier.context.thresholds import CLOSING, OPENING, Token, statements, tokens_of

# Patterns take what they have looked at, so that time grows with the length of a file.
_DEFINE = re.compile(r"\s*#\s*define\s+(\w+)[ \t]+(.*)", re.DOTALL)
_COMMENT = re.compile(r"//[^\n]*+|/\*.*?(?:\*/|\Z)", re.DOTALL)
_UNCHANGING = frozenset(("parameter", "constant", "const"))
_MAX_CHARACTERS = 4_000_000  # far more than a model of 10,000 lines has
_MAX_VALUE = 400  # characters of a value


@dataclass(frozen=True, slots=True)
class Source:
    """One file.

    Attributes:
        text: its text.
        shown: what messages call it.
        is_modelica: whether it is Modelica, and not C.
        constants: values of its macros, constants and parameters by name, as written; empty if one is long.
        others: values that it gives to names without declaring them as constants. In Modelica these may be
            modifiers of constants, such as ``Base(limit = 8)``.
    """

    text: str
    shown: str
    is_modelica: bool
    constants: Mapping[str, Sequence[str]]
    others: Mapping[str, Sequence[str]]


def read_source(text: str, shown: str, *, is_modelica: bool) -> Source | None:
    """Return what a file says; None if it is too long to be read."""
    if len(text) > _MAX_CHARACTERS:
        return None
    constants: dict[str, list[str]] = {}
    others: dict[str, list[str]] = {}
    for tokens in statements(text):
        for name, value, is_constant in _assignments(text, tokens, is_modelica=is_modelica):
            stated = " ".join(_COMMENT.sub(" ", value).split())
            (constants if is_constant else others).setdefault(name, []).append(stated)
    return Source(text, shown, is_modelica, constants, others)


def constants_of(source: Source, library: Sequence[Source]) -> dict[str, str]:
    """Return values of the constants that a file may use; ``5 or 9`` if there are two.

    Args:
        source: the file.
        library: all files: those of the same language may define its constants, or change them.
    """
    alike = [each for each in library if each.is_modelica == source.is_modelica and each is not source]
    found: dict[str, list[str]] = {}
    for file in (source, *alike):
        for name, values in file.constants.items():
            found.setdefault(name, []).extend(values)
    for file in (source, *alike):
        for name in found.keys() & file.others.keys():
            if source.is_modelica:  # which modifier holds is not told apart
                found[name] += file.others[name]
            else:  # a variable of the same name
                del found[name]
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


def _assignments(text: str, tokens: Sequence[Token], *, is_modelica: bool) -> Iterator[tuple[str, str, bool]]:
    """Return what a statement sets, equates, declares with a value, modifies or defines.

    Of each: the name, of ``a.b`` or ``a->b`` its last part; the value; and whether it declares a constant.
    """
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
                yield defined[1], defined[2].replace("\\\n", " "), True
        elif token.text in ("=", ":="):
            last = begins.get(i - 1, i) - 1  # before indices and modifiers
            if last >= 0 and tokens[last].text == "der" and last + 2 < i:
                last += 2
            if last >= 0 and tokens[last].kind == "name":
                yield tokens[last].text.strip("'"), _value(text, tokens, i), is_constant and not opened


def _value(text: str, tokens: Sequence[Token], sign: int) -> str:
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
