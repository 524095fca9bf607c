"""Tokens of a formula's text, and errors that point to a position in it."""

import re
from dataclasses import dataclass
from typing import Literal

from falsifier.errors import FormulaError
from falsifier.stl.names import scan_name, scan_word

_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_SYMBOL = re.compile(r"<->|<=>|->|=>|<=|>=|==|!=|&&|\|\||[-+*/^<>!&|()\[\],]")
_SPACE = re.compile(r"\s*")
_SPELLINGS = {
    "<=>": "<->", "=>": "->", "|": "or", "||": "or", "&": "and", "&&": "and", "!": "not",
    "always": "G", "eventually": "F", "until": "U", "next": "X",
}  # fmt: skip
_HINTS = {
    "=": "equality is ==, less or equal is <=",
    "%": "write the number without a percent sign",
    "'": "a single quote opens a Modelica name and needs a second one",
    '"': "a double quote opens a name and needs a second one",
    "≤": "write <=", "≥": "write >=", "≠": "write !=", "¬": "write not", "∧": "write and", "∨": "write or",
    "→": "write ->", "↔": "write <->", "□": "write G", "◇": "write F", "·": "write *", "~": "write not",
}  # fmt: skip


# Maximum number of characters of a line that errors show.
_SHOWN_LINE = 160


@dataclass(frozen=True, slots=True)
class Token:
    """One token of a formula's text.

    Attributes:
        kind: its kind.
        text: the number, the signal's name in the model, or the canonical spelling of a symbol or reserved
        word. written: the text as written in the formula. position: position of its first character, from 0.
    """

    kind: Literal["number", "name", "symbol", "end"]
    text: str
    written: str
    position: int

    @property
    def end(self) -> int:
        """Position after its last character."""
        return self.position + len(self.written)

    @property
    def shown(self) -> str:
        """How error messages refer to it."""
        return "the end" if self.kind == "end" else repr(self.written[:_SHOWN_LINE])


def tokenize(text: str) -> list[Token]:
    """Return the tokens of a text; the last one marks its end.

    Raises:
        FormulaError: pointing at a character that cannot start a token.
    """
    tokens: list[Token] = []
    position = _after_space(text, 0)
    while position < len(text):
        tokens.append(_token(text, position))
        position = _after_space(text, tokens[-1].end)
    return [*tokens, Token("end", "", "", len(text.rstrip()))]


def syntax_error(text: str, problem: str, position: int, hint: str) -> FormulaError:
    """Return an error that shows the line, a caret under the position (counted from 0) and a hint."""
    start = text.rfind("\n", 0, position) + 1
    end = text.find("\n", position)
    line = text[start : len(text) if end < 0 else end].rstrip()
    column = position - start
    if len(line) > _SHOWN_LINE:
        first = max(0, column - _SHOWN_LINE // 2)
        line, column = line[first : first + _SHOWN_LINE], column - first
    caret = " " * column + "^"
    return FormulaError(f"{problem} (position {position + 1})\n  {line}\n  {caret}\nhint: {hint}")


def _token(text: str, position: int) -> Token:
    if number := _NUMBER.match(text, position):
        return Token("number", number[0], number[0], position)
    if word := scan_word(text, position):
        return Token("symbol", _SPELLINGS.get(word, word), word, position)
    if name := scan_name(text, position):
        return Token("name", name[0], text[position : name[1]], position)
    if symbol := _SYMBOL.match(text, position):
        return Token("symbol", _SPELLINGS.get(symbol[0], symbol[0]), symbol[0], position)
    hint = _HINTS.get(
        text[position], "it has no meaning in a formula; put names that contain it in double quotes"
    )
    raise syntax_error(text, f"unexpected character {text[position]!r}", position, hint)


def _after_space(text: str, position: int) -> int:
    space = _SPACE.match(text, position)
    return space.end() if space else position
