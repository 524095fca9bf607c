"""Words, numbers and signs of source code, with their lines; Modelica and C have the same ones."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from falsifier.errors import SpecError

Kind = Literal["name", "number", "text", "sign", "directive"]
# Far more than a model of 10,000 lines has.
_MAX_CHARACTERS = 20_000_000
# Comments and texts that are not closed end with the source, and names in quotes have a limited length:
# otherwise, each of their beginnings would be searched up to the end.
_TOKEN = re.compile(
    r"""
    (?P<directive>(?:(?<=\n)|\A)[ \t]*\#(?:[^\n\\]|\\.)*)
  | (?P<blank>\s*\n|\s+)
  | (?P<comment>//[^\n]*|/\*.*?(?:\*/|\Z))
  | (?P<number>0[xX][0-9a-fA-F]+\.?[0-9a-fA-F]*(?:[pP][+-]?\d+)?[a-zA-Z]*
             |(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[a-zA-Z]*)
  | (?P<name>[^\W\d]\w*|'(?:[^'\\\n]|\\.){1,200}')
  | (?P<text>"(?:[^"\\]|\\.)*(?:"|\\?\Z))
  | (?P<sign><=|>=|==|!=|<>|:=|&&|\|\||->|\+\+|--|[-+*/%&|^]=|.)
    """,
    re.VERBOSE | re.DOTALL,
)


@dataclass(frozen=True, slots=True)
class Token:
    """One word, number, text or sign.

    Attributes:
        kind: what it is.
        text: as written.
        line: its line, from 1.
        start: its first character in the source, from 0.
        end: the character behind it.
    """

    kind: Kind
    text: str
    line: int
    start: int
    end: int


def tokens_of(source: str, shown: str) -> list[Token]:
    """Return the tokens of a source without blanks and comments.

    Raises:
        SpecError: if the source is too long.
    """
    if len(source) > _MAX_CHARACTERS:
        raise SpecError(
            f"{shown}: has {len(source):,} characters, more than {_MAX_CHARACTERS:,}; split it, and name "
            "the part that matters"
        )
    return list(_tokens(source))


def _tokens(source: str) -> Iterator[Token]:
    line = 1
    for found in _TOKEN.finditer(source):
        kind = found.lastgroup
        if kind not in ("blank", "comment"):
            yield Token(kind, found[0], line, found.start(), found.end())  # type: ignore[arg-type]
        line += found[0].count("\n")


def written(source: str, tokens: list[Token]) -> str:
    """Return the source of some successive tokens in one line, with the comments among them."""
    if not tokens:
        return ""
    text = re.sub(r"//([^\n]*)\n", r"/*\1 */ ", source[tokens[0].start : tokens[-1].end])
    return " ".join(text.split())
