"""Structures of C: what a file that fills them says of the values of their fields."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from falsifier.context.thresholds import tokens_of

_STRUCT = re.compile(r"\bstruct\s*+(\w*+)\s*+\{([^{}]*+)\}\s*+(\w*+)")
_ALIAS = re.compile(r"\btypedef\s++struct\s++(\w++)\s++(\w++)\s*+;")
_FILLED = re.compile(r"\b(\w++)\s++\w++\s*+=\s*+(?=\{)")
_MAX_DEPTH = 20  # of structures within structures
# The values within braces, with the names of those that are stated as .name = value.
_Values = list[tuple[str, "str | _Values"]]


@dataclass(frozen=True, slots=True)
class Structures:
    """What a file says of structures.

    Attributes:
        fields: types and names of the fields of each structure, by the structure's name.
        filled: types and values of variables that are declared with values in braces.
    """

    fields: Mapping[str, Sequence[tuple[str, str]]] = field(default_factory=dict)
    filled: Sequence[tuple[str, _Values]] = ()


def read_structures(text: str) -> Structures:
    """Return what C says of structures.

    Args:
        text: a file without its comments.
    """
    fields: dict[str, Sequence[tuple[str, str]]] = {}
    for found in _STRUCT.finditer(text):
        declared = tuple(each for line in found[2].split(";") for each in _declared(line))
        fields |= {name: declared for name in (found[1], found[3]) if name}
    for alias in _ALIAS.finditer(text):
        fields.setdefault(alias[2], (("", alias[1]),))
    filled, end = [], 0
    for found in _FILLED.finditer(text):
        if found.start() >= end:
            values, end = _values(text, found.end())
            filled.append((found[1], values))
    return Structures(fields, filled)


def fields_of(found: Sequence[Structures]) -> Iterator[tuple[str, str]]:
    """Return names and values of the fields that are filled, by the structures of all files."""
    known = {name: fields for each in found for name, fields in each.fields.items()}
    for each in found:
        for kind, values in each.filled:
            yield from _with_names(kind, values, known)


def _declared(line: str) -> Iterator[tuple[str, str]]:
    """Return type and name of each field of ``real_T a[2], b``."""
    first, *others = (re.findall(r"\w+", part) for part in re.sub(r"\[[^\]]*+\]", "", line).split(","))
    if len(first) > 1:
        yield from ((first[-2], words[-1]) for words in (first, *others) if words)


def _values(text: str, at: int) -> tuple[_Values, int]:
    """Return the values between a brace and the one that closes it, and where that is."""
    values: _Values = []
    opened: list[_Values] = [values]
    told = ""  # since the last comma or brace
    for token in tokens_of(text, at):
        at = token.end
        if token.text in ("{", "}", ","):
            name, _, value = told.rpartition("=")
            if token.text == "{":
                inner: _Values = []
                opened[-1].append((name.lstrip("."), inner))
                opened.append(inner)
            elif told:
                opened[-1].append((name.lstrip("."), value))
            told = ""
            if token.text == "}":
                opened.pop()
                if len(opened) == 1:
                    break
        elif token.text == ";":
            break
        elif token.kind != "directive":
            told += token.text
    return (values[0][1] if values and isinstance(values[0][1], list) else []), at


def _with_names(
    kind: str, values: _Values, known: Mapping[str, Sequence[tuple[str, str]]], depth: int = 0
) -> Iterator[tuple[str, str]]:
    fields = known.get(kind, ())
    if len(fields) == 1 and not fields[0][0]:  # another name of this structure
        fields = known.get(fields[0][1], ())
    at = 0
    for label, value in values:
        if label:
            at = next((i for i, (_, name) in enumerate(fields) if name == label), at)
        if at < len(fields):
            inner, name = fields[at]
            if isinstance(value, str):
                yield name, value
            elif depth < _MAX_DEPTH:
                yield from _with_names(inner, value, known, depth + 1)
        at += 1
