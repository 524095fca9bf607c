"""Words, numbers and signs of source code, with their lines; Modelica and C have the same ones."""

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from falsifier.errors import SpecError

# Far more than a model of 10,000 lines has; as many are read in some seconds.
_MAX_CHARACTERS = 4_000_000
OPENING, CLOSING = frozenset("([{"), frozenset(")]}")
# Every alternative either takes what it has looked at or gives up after a limited number of characters, so
# that time grows with the length of a source: comments and texts that are not closed end with it, and names
# in quotes have a limited length.
_TOKEN = re.compile(
    r"""
    (?P<directive>(?:(?<=\n)|\A)[ \t]*+\#(?:[^\n\\]|\\.)*+)
  | (?P<blank>[^\S\n]*+\n|\s++)
  | (?P<comment>//[^\n]*+|/\*.*?(?:\*/|\Z))
  | (?P<number>0[xX][0-9a-fA-F]++\.?[0-9a-fA-F]*+(?:[pP][+-]?\d++)?[a-zA-Z]*+
             |(?:\d++\.?\d*+|\.\d++)(?:[eE][+-]?\d++)?[a-zA-Z]*+)
  | (?P<name>[^\W\d]\w*+|'(?:[^'\\\n]|\\.){1,200}')
  | (?P<text>"(?:[^"\\]|\\.)*+(?:"|\\?\Z))
  | (?P<sign><=|>=|==|!=|<>|:=|&&|\|\||->|\+\+|--|[-+*/%&|^]=|.)
    """,
    re.VERBOSE | re.DOTALL,
)


class Token(NamedTuple):
    """One word, number, text or sign.

    Attributes:
        kind: ``name``, ``number``, ``text``, ``sign`` or ``directive``.
        text: as written.
        line: its line, from 1.
        start: its first character in the source, from 0.
        end: the character behind it.
    """

    kind: str
    text: str
    line: int
    start: int
    end: int


def tokens_of(source: str, shown: str) -> Iterator[Token]:
    """Return the tokens of a source without blanks and comments.

    Raises:
        SpecError: if the source is too long.
    """
    if len(source) > _MAX_CHARACTERS:
        raise SpecError(
            f"{shown}: has {len(source):,} characters, more than {_MAX_CHARACTERS:,}; split it, and name "
            "the part that matters"
        )
    return _tokens(source)


def _tokens(source: str) -> Iterator[Token]:
    line = 1
    for found in _TOKEN.finditer(source):
        kind = found.lastgroup or ""
        if kind in ("blank", "comment"):
            line += found[0].count("\n")
            continue
        yield Token(kind, found[0], line, found.start(), found.end())
        if kind in ("directive", "text"):
            line += found[0].count("\n")


def written(source: str, start: int, end: int) -> str:
    """Return a piece of a source in one line, with the comments in it."""
    return " ".join(re.sub(r"//([^\n]*)\n", r"/*\1 */ ", source[start:end]).split())


def parts(tokens: Iterable[Token], sign: str) -> Iterator[list[Token]]:
    """Return what stands between the signs that are outside of brackets."""
    depth, part = 0, list[Token]()
    for token in tokens:
        depth += (token.text in OPENING) - (token.text in CLOSING)
        if token.text == sign and depth == 0:
            yield part
            part = []
        else:
            part.append(token)
    yield part
