"""Which constants are compared with which signals, in conditions of any of the languages that are read."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, pairwise
from math import isinf
from typing import NamedTuple

_RELATIONS = ("<", "<=", ">", ">=", "==", "!=", "<>")
# What ends an operand at its own depth of brackets.
_BOUNDING = "and or not && || ! if then else elseif when elsewhen while for loop , ; ? : = := return"
_BOUNDARIES = frozenset(_BOUNDING.split())
_DECIMAL = r"(?:\d++\.?\d*+|\.\d++)(?:[eE][-+]?\d++)?"
_HEXADECIMAL = r"0[xX][0-9a-fA-F]++(?:\.?[0-9a-fA-F]*+[pP][-+]?\d++)?"
_NUMBER = re.compile(rf"([-+]?) ?(?:({_HEXADECIMAL})|({_DECIMAL}))[fFlLuU]*$")
# (unsigned int)7; with a sign, only names of numeric types, as (limit)-3 is a difference.
_TYPE = r"(?:(?:u?int|float|real|double|single)\d*+(?:_[tT])?|(?:un)?signed|long|short|char)\b"
_CAST = rf"\(\s*+(?:(?:{_TYPE}\s*+){{1,4}}+\)\s*+(?=[-+]?\.?\d)|(?:[^\W\d]\w*+\s*+){{1,4}}+\)\s*+(?=\.?\d))"
_MAX_LENGTH = 160
OPENING, CLOSING = frozenset("([{"), frozenset(")]}")
# Every alternative either takes what it has looked at or gives up after a limited number of characters, so
# that time grows with the length of a text.
_TOKEN = re.compile(
    rf"(?P<blank>\s++|{_CAST})"
    r"""
  | (?P<comment>//[^\n]*+|/\*.*?(?:\*/|\Z))
  | (?P<directive>^[ \t]*+\#(?:[^\n\\]|\\.)*+)
  | (?P<number>0[xX][0-9a-fA-F]++\.?[0-9a-fA-F]*+(?:[pP][+-]?\d++)?[a-zA-Z]*+
             |(?:\d++\.?\d*+|\.\d++)(?:[eE][+-]?\d++)?[a-zA-Z]*+)
  | (?P<name>[^\W\d]\w*+|'(?:[^'\\\n]|\\.){1,200}')
  | (?P<text>"(?:[^"\\]|\\.)*+(?:"|\\?\Z))
  | (?P<sign><=|>=|==|!=|<>|:=|&&|\|\||->|\+\+|--|[-+*/%&|^]=|.)
    """,
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)


class SourceToken(NamedTuple):
    """One word, number, text, sign or line of C's preprocessor, and where it stands in its file."""

    kind: str  # name, number, text, sign or directive
    text: str
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Threshold:
    """One comparison with a constant.

    It has levels if one variable is compared with nothing but a number or a constant: that, or its values.
    """

    names: frozenset[str]  # variables that are not constants
    text: str  # as written, with the values of named constants: u > limit (limit = 9.5)
    levels: tuple[float, ...]
    place: str  # file and line, or block


def thresholds(
    text: str, constants: Mapping[str, str], place: str, *, is_dotted: bool = False, has_lines: bool = False
) -> Iterator[Threshold]:
    """Return the comparisons of variables with numbers or named constants.

    ``text`` is a condition, a statement or a whole file, ``place`` a file or block, with the number of the
    line if it ``has_lines``. ``is_dotted``: ``a.b`` is a variable of this name, as in Modelica, and not the
    member ``b``. ``constants`` are the values of named constants, as written.
    """
    seen = set()
    line, at = 1, 0
    for tokens in statements(text):
        for sign, first, end in sorted(_compared(tokens)):
            if tokens[end - 1].end - tokens[first].start > _MAX_LENGTH:
                continue
            line, at = line + text.count("\n", at, tokens[sign].start), tokens[sign].start
            shown = f"{place}:{line}" if has_lines else place
            sides = tokens[first:sign], tokens[sign + 1 : end]
            found = _threshold(text, sides, constants, shown, is_dotted=is_dotted)
            if found is not None and found.text not in seen:
                seen.add(found.text)
                yield found


def _compared(tokens: Sequence[SourceToken]) -> Iterator[tuple[int, int, int]]:
    """Return where the sign of each comparison is, where its left side begins and its right side ends.

    Comparisons in brackets that are not closed end with the tokens.
    """
    # Of each bracket around: where the operand begins, and the comparison that it ends, if any.
    opened: list[tuple[int, tuple[int, int] | None]] = [(0, None)]
    for i, token in enumerate(tokens):
        is_closing, is_sign = token.text in CLOSING, token.text in _RELATIONS
        if token.text in OPENING:
            opened.append((i + 1, None))
        elif is_closing or is_sign or token.text in _BOUNDARIES or token.kind == "directive":
            first, begun = opened.pop()
            if begun is not None and first < i:
                yield *begun, i
            if is_sign:
                opened.append((i + 1, (i, first) if first < i else None))
            elif not is_closing or not opened:
                opened.append((i + 1, None))
    yield from ((*begun, len(tokens)) for first, begun in opened if begun is not None and first < len(tokens))


def _threshold(
    text: str,
    sides: tuple[Sequence[SourceToken], Sequence[SourceToken]],
    constants: Mapping[str, str],
    place: str,
    *,
    is_dotted: bool,
) -> Threshold | None:
    """Return what is compared; None if that is no variable, or with no constant."""
    tokens = [*sides[0], *sides[1]]
    shown = " ".join(text[tokens[0].start : tokens[-1].end].split())
    paths = {path: name for side in sides for path, name in _variables(side, is_dotted=is_dotted)}
    known = {path: constants[name] for path, name in sorted(paths.items()) if name in constants}
    named = {paths[path]: value for path, value in known.items() if len(value) <= _MAX_LENGTH}
    stated_values = [value for stated in named.values() for value in stated.split(" or ")]
    variables = frozenset(paths.keys() - known.keys())
    stating = chain(tokens, *map(tokens_of, stated_values))
    if not variables or not any(token.kind == "number" for token in stating):
        return None
    levels: tuple[float, ...] = ()
    for side, other in (sides, sides[::-1]):
        if variables == {path for path, _ in _variables(side, is_dotted=is_dotted)} and _is_name(side):
            constant = " ".join(token.text for token in other)
            levels = tuple(_numbers(stated_values if _is_name(other) else [constant]))
    said = f" ({', '.join(f'{n} = {v}' for n, v in named.items())})" if named else ""
    return Threshold(variables, f"{shown}{said}", levels, place)


def _numbers(texts: Iterable[str]) -> Iterator[float]:
    """Return those of some texts that are nothing but a number, and none that is too large for one."""
    for text in texts:
        if found := _NUMBER.match(" ".join(token.text for token in tokens_of(text)).strip("() ")):
            sign, hexadecimal, decimal = found.groups()
            with suppress(OverflowError):
                number = float(decimal) if decimal else float.fromhex(hexadecimal)
                if not isinf(number):
                    yield -number if sign == "-" else number


def _is_name(side: Sequence[SourceToken]) -> bool:
    """Whether an operand is nothing but a name, such as ``(m->u)``."""
    is_called = any(a.kind == "name" and b.text == "(" for a, b in pairwise(side))
    return not is_called and all(t.kind == "name" or t.text in (".", "->", "(", ")") for t in side)


def _variables(tokens: Sequence[SourceToken], *, is_dotted: bool) -> Iterator[tuple[str, str]]:
    """Names that are no functions, with the last part of each: of ``a->b`` the name is ``b``, too."""
    path = ""
    for token, after in pairwise(chain(tokens, (None,))):
        if token is None or token.kind != "name":
            path = f"{path}." if token is not None and token.text == "." and path and is_dotted else ""
        elif after is None or after.text not in ("(", ".", "->"):
            yield f"{path}{token.text}", token.text
            path = ""
        else:
            path = f"{path}{token.text}" if after.text == "." else ""


def tokens_of(text: str) -> Iterator[SourceToken]:
    """Return the tokens of a text in any of the languages, without blanks and comments."""
    for found in _TOKEN.finditer(text):
        if found.lastgroup not in ("blank", "comment"):
            yield SourceToken(found.lastgroup or "", found[0], found.start(), found.end())


def statements(text: str) -> Iterator[list[SourceToken]]:
    """Return the tokens between semicolons outside of square brackets, where they end rows of a matrix."""
    tokens: list[SourceToken] = []
    depth = 0
    for token in tokens_of(text):
        depth += (token.text == "[") - (token.text == "]")
        tokens.append(token)
        if token.text == ";" and depth <= 0:
            yield tokens
            tokens, depth = [], 0
    yield tokens
