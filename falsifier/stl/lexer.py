"""Tokens of a formula's text, names of variables among them, and errors that say where and what to write.

Most names of FMU variables need no quotes: ``speed``, ``a.b[1]``, ``x[1,2]``, ``der(x)``, that of a component
``a.der(x)``, and Modelica names whose single quotes are part of the name: ``car.'front left'.v``. Any other
name is written in double quotes, which are not part of it: ``"G"``, ``"wheel speed"``.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Literal

from falsifier.errors import FormulaError

FUNCTIONS = ("abs", "sqrt", "exp", "log", "sin", "cos", "min", "max")
TEMPORAL = ("G", "F", "U", "X", "always", "eventually", "until", "next")
_COMPARING = ("<", "<=", ">", ">=", "==", "!=")
RESERVED = frozenset((*TEMPORAL, "not", "and", "or", "true", "false"))

_IDENTIFIER = r"(?:[^\W\d]|\$)[\w$]*"
_PART = rf"(?:{_IDENTIFIER}|'(?:[^'\\\n]|\\.)+')(?:\[ *\d+(?: *, *\d+)* *\])?"
_PATH = rf"{_PART}(?:\.{_PART})*"
_WORD_PATTERN = re.compile(rf"({_IDENTIFIER})(?![\w$.])")
_PATH_PATTERN = re.compile(_PATH)
_DERIVATIVE = re.compile(r"der\(\s*")
_DERIVATIVE_END = re.compile(r"\s*(,\s*\d+)?\s*\)")
_QUOTED_PATTERN = re.compile(r'"((?:[^"\\]|\\.)+)"', re.DOTALL)

_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
# The whole part of a number that is written with a decimal comma.
_DECIMAL_COMMA = re.compile(r"(?<![\w.])\d+(?=,\d)")
# A window as other tools write it, up to the colon.
_BOUNDS_WITH_COLON = re.compile(
    r"(?:[GFU]|always|eventually|until|alw|ev)_?\s*\[\s*[\d.eE+-]+\s*(?:[um]?s|min|h)?\s*[:;]\Z"
)
_SYMBOL = re.compile(r"<->|<=>|->|=>|<=|>=|==|!=|&&|\|\||[-+*/^<>!&|()\[\],]")
_SPELLINGS = {
    "<=>": "<->", "=>": "->", "|": "or", "||": "or", "&": "and", "&&": "and", "!": "not",
    "always": "G", "eventually": "F", "until": "U", "next": "X",
}  # fmt: skip
_COMMENT = "formulas have no comments; say it in the requirement's description"
_HINTS = {
    "#": f"{_COMMENT}; put names that contain it in double quotes",
    "=": "equality is ==, less or equal is <=",
    "%": "write 5% of x as 0.05*x, and a number whose unit is % without the sign",
    "°": "write numbers without units; else quote the name",
    "'": "a single quote opens a Modelica name and needs a second one",
    '"': "a double quote opens a name and needs a second one",
    "≤": "write <=", "≥": "write >=", "≠": "write !=", "¬": "write not", "∧": "write and", "∨": "write or",
    **dict.fromkeys("→⇒⟹", "write ->"), **dict.fromkeys("↔⇔", "write <->"), "□": "write G", "◇": "write F",
    "·": "write *", "~": "write not; unequal is !=",
    **dict.fromkeys("−–", "write -"), **dict.fromkeys("‘’“”„", "write straight quotes"),
}  # fmt: skip
# Units of the bounds of windows, in s.
UNITS = {
    "us": Decimal("1e-6"), "ms": Decimal("1e-3"), "s": Decimal(1), "min": Decimal(60), "h": Decimal(3600),
}  # fmt: skip
_PAST = (
    "there are no operators on the past; for 20 s, write G (a -> {0}[0,2] b) as "
    "G[0,18] (F[2,2] a -> {1}[0,2] b), which begins at 2 s"
)
# What was meant by a name; single capitals are operators only as they are written.
_INSTEAD = {
    **dict.fromkeys(
        ("once", "since", *"OPSY"), _PAST.format("once", "F") + "; G (a -> once b) is not (not b U a)"
    ),
    **dict.fromkeys(("historically", "H"), _PAST.format("historically", "G")),
    **dict.fromkeys(("W", "weak_until", "weakuntil"), "a W b is not (not b U not a)"),
    **dict.fromkeys(("R", "release"), "a R b is (b U (a and b)) or G b"),
    "globally": "write G or always", "finally": "write F or eventually", "implies": "write ->",
    "g": "operators are capital letters: write G", "f": "operators are capital letters: write F",
    "u": "operators are capital letters: write U", "alw": "write G or always", "ev": "write F or eventually",
    "iff": "write <->", "xor": "write not (a <-> b)",
    **dict.fromkeys(("edge", "rise", "rising", "rose"), "a becomes true: not a and X a"),
    **dict.fromkeys(
        ("pre", "prev", "previous", "delay", "last", "mean", "average", "integral", "rms"),
        "formulas know no values of other samples; let the model compute it",
    ),
    **dict.fromkeys(("derivative", "ddt", "diff"), "write der(x) if the model has it; else use ramp_limit"),
    **dict.fromkeys(("if", "when", "whenever"), "if a then b is a -> b"),
    "pow": "write x^y", "ln": "the natural logarithm is log",
}  # fmt: skip
# What to do where one or two symbols stand in place of a formula, a signal or a number.
_MISPLACED = {
    "[]": "[] is written G or always", "<>": "<> is written F or eventually",
    **dict.fromkeys("[]", "write windows directly after G, F or U"),
    ")": "there is nothing between the parentheses, or one parenthesis too many",
    "*": "write powers as x^y", "+": "write numbers without a plus sign",
    "|": "write absolute values as abs(x)", "//": _COMMENT,
}  # fmt: skip
# The same where a symbol does not fit the one before it.
ARROWS = {"==>": "implication is ->, equivalence <->", "-->": "implication is ->, equivalence <->"}
_SPLIT = {"<>": "unequal is !=", "//": _COMMENT, **ARROWS}
JOIN = (
    "join two formulas with and, or, ->; numbers and signals with + - * /; write numbers without units, and "
    "names with blanks in double quotes"
)
# Maximum number of characters of a line that errors show.
_SHOWN_LINE = 160


@dataclass(frozen=True, slots=True)
class Token:
    """One token of a formula's text."""

    kind: Literal["number", "name", "symbol", "end"]  # its kind
    # The number, the signal's name in the model, or the canonical spelling of a symbol or reserved word.
    text: str
    written: str  # the text as written in the formula
    position: int  # position of its first character, from 0

    @property
    def end(self) -> int:
        """Position after its last character."""
        return self.position + len(self.written)

    @property
    def shown(self) -> str:
        """How error messages refer to it."""
        return "the end" if self.kind == "end" else repr(self.written[:_SHOWN_LINE])


def tokenize(text: str) -> list[Token]:
    """Return the tokens of a text and one for its end; FormulaError pointing at what cannot start a token."""
    tokens: list[Token] = []
    position = 0
    while position < len(text):
        if text[position].isspace():
            position += 1
        else:
            tokens.append(_token(text, position))
            position = tokens[-1].end
    return [*tokens, Token("end", "", "", len(text.rstrip()))]


def syntax_error(text: str, problem: str, position: int, hint: str) -> FormulaError:
    """Return an error that shows the line, a caret under the position (counted from 0) and a hint."""
    if any(position in (number.start(), number.end()) for number in _DECIMAL_COMMA.finditer(text)):
        hint = "write decimals with a point"
    start = text.rfind("\n", 0, position) + 1
    end = text.find("\n", position)
    line = text[start : len(text) if end < 0 else end].rstrip()
    column = position - start
    if len(line) > _SHOWN_LINE:
        first = max(0, column - _SHOWN_LINE // 2)
        line, column = line[first : first + _SHOWN_LINE], column - first
    caret = " " * column + "^"
    return FormulaError(f"{problem} (position {position + 1})\n  {line}\n  {caret}\nhint: {hint}")


def hint_for(token: Token) -> str:
    """Return what to write instead of a name that was meant as an operator, perhaps with a window."""
    written = token.text.partition("[")[0].rstrip("_")  # as Breach writes alw_[0,20]
    word = written.lower()
    lower = f"write operators in lower case: {word}" if word in RESERVED else ""
    return "" if token.kind != "name" else _INSTEAD.get(written) or _INSTEAD.get(word) or lower


def hint_at(tokens: Sequence[Token], index: int) -> str:
    """Return what to do if this token stands where a formula, a signal or a number is expected."""
    token, previous = tokens[index], tokens[index - 1] if index else None
    if token.text == "U":
        return f'it belongs between two formulas; write a signal of that name as "{token.written}"'
    pair = "".join(t.text for t in tokens[index : index + 2])
    if found := _MISPLACED.get(pair) or _MISPLACED.get(token.written):
        return found
    if (
        previous
        and previous.end == token.position
        and (found := _SPLIT.get(previous.written + token.written))
    ):
        return found
    if previous and previous.text in ("and", "or") and token.text in _COMPARING:
        return "repeat what is compared: x >= 0 and x <= 3"
    if token.kind == "symbol" and previous and previous.written in RESERVED:
        return f'{previous.written} is a reserved word; write a signal of that name as "{previous.written}"'
    return "something is missing before it"


def hint_after(token: Token, previous: Token) -> str:
    """Return what to do if a token stands behind a complete formula."""
    if known := hint_for(token) or hint_for(previous):
        return known
    if token.text in UNITS and previous.kind == "number":
        return "only the bounds of windows have units; convert the number to the signal's own unit"
    if token.text == ")":
        return "there is one ')' too many"
    if token.text == "[":
        return "write windows directly after G, F or U, indices directly after a name"
    return JOIN


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
    if _BOUNDS_WITH_COLON.search(text, 0, position + 1):
        hint = "write the bounds of windows with a comma: [a,b]"
    elif text[position] == "." and '"' in (text[position - 1 : position], text[position + 1 : position + 2]):
        hint = "put the whole name in one pair of double quotes"
    raise syntax_error(text, f"unexpected character {text[position]!r}", position, hint)


# -- names -----------------------------------------------------------------------------------------------


def scan_name(text: str, start: int) -> tuple[str, int] | None:
    """Return the variable's name at this position and the position after it; None if there is no name.

    Reserved words are names only in quotes or as part of a longer name (``G.x``).
    """
    if quoted := _QUOTED_PATTERN.match(text, start):
        return re.sub(r"\\(.)", r"\1", quoted[1], flags=re.DOTALL), quoted.end()
    if derivative := _DERIVATIVE.match(text, start):
        inner = scan_name(text, derivative.end())
        end = _DERIVATIVE_END.match(text, inner[1]) if inner else None
        if inner and end:
            order = re.sub(r"\s", "", end[1] or "")
            return f"der({inner[0]}{order})", end.end()
    if scan_word(text, start):
        return None
    if path := _PATH_PATTERN.match(text, start):
        name = path[0].replace(" ", "") if "'" not in path[0] else path[0]
        inner = scan_name(text, path.end() - 3) if name.endswith(".der") else None
        if inner and inner[0].startswith("der("):  # the derivative of a component, plant.der(x)
            return name.removesuffix("der") + inner[0], inner[1]
        return name, path.end()
    return None


def scan_word(text: str, start: int) -> str | None:
    """Return the reserved word at this position, or the function name if a parenthesis follows it."""
    match = _WORD_PATTERN.match(text, start)
    if match is None:
        return None
    is_call = text[match.end() :].lstrip().startswith("(")
    return match[1] if match[1] in RESERVED or (match[1] in FUNCTIONS and is_call) else None


def name_text(name: str) -> str:
    """Return a name as written in a formula: unchanged if it can be parsed that way, else in double quotes.

    >>> print(name_text("der(x)"), name_text("G"), name_text("wheel speed"))
    der(x) "G" "wheel speed"
    """
    if scan_name(name, 0) == (name, len(name)):
        return name
    escaped = re.sub(r'(["\\])', r"\\\1", name)
    return f'"{escaped}"'
