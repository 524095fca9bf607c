"""Any text, written so that a terminal or another language reads this text and nothing else.

Names come from spec files, FMUs and journals that others wrote. Whatever stands in one, it must not become
code in a script, a formula in a spreadsheet, or markup in a report. ``repr`` and the JSON and XML libraries
do the rest.
"""

import csv
import re
import shlex
from collections.abc import Iterable
from decimal import Decimal
from io import StringIO
from math import isfinite

# Control characters other than tab and newline, and characters that hide or reorder text.
_ACTING = (
    r"\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    r"\U000e0000-\U000e007f"
)
_CONTROLS = re.compile(f"[{_ACTING}]")
# These, and what UTF-8 or XML 1.0 cannot contain.
_UNPRINTABLE = re.compile(rf"[{_ACTING}\ud800-\udfff\ufffe\uffff]")
# What cannot be part of a string in any language.
_UNWRITABLE = re.compile("[\x00\ud800-\udfff]")
_REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
# Colours, cursor movements and the like; titles, links and clipboard contents with their ends. No character
# that starts a sequence may occur inside one, so that the search stays linear.
_SEQUENCES = re.compile(
    r"(?:\x1b\[|\x9b)[0-?]*[ -/]*[@-~]"
    r"|(?:\x1b[\]PX^_]|[\x90\x98\x9d-\x9f])[^\x07\x1b\x80-\x9f\n]*(?:\x07|\x1b\\|\x9c)"
)
_FORMULA_STARTS = tuple("=+-@＝＋－＠\t\n")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_MODELICA_PATH = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)
_MODELICA_ESCAPES = {
    "\a": "\\a", "\b": "\\b", "\f": "\\f", "\n": "\\n", "\r": "\\r", "\t": "\\t", "\v": "\\v",
    '"': '\\"', "'": "\\'", "\\": "\\\\",
}  # fmt: skip


def printable(text: str) -> str:
    r"""Return the text without escape sequences, control characters and unpaired surrogates.

    Newlines and tabs stay. Takes a time proportional to the length.

    >>> printable("\x1b[31mred\x1b[0m \x1b]0;title\x07and\r plain")
    'red and plain'
    """
    text = _CONTROLS.sub("", _SEQUENCES.sub("", text))
    return text.encode("utf-8", "replace").decode("utf-8")


def plain(text: str) -> str:
    r"""Return a text without control characters, invisible ones and those that no file can hold; lines stay.

    >>> plain("a\x1b[31mb\u200bc")
    'a�[31mb�c'
    """
    return _UNPRINTABLE.sub(_REPLACEMENT, text)


def one_line(text: str) -> str:
    r"""Return a text as one plain line, for titles, comments and messages.

    >>> one_line("a\nb\u2028c")
    'a b c'
    """
    return plain(" ".join(text.splitlines()))


def shell_word(word: object) -> str:
    """Return a word of a command to copy: quoted where it must be, and no option if it begins with a dash.

    >>> shell_word("my run"), shell_word("-run")
    ("'my run'", './-run')
    """
    return shlex.quote(f"./{word}" if str(word).startswith("-") else str(word))


def python_docstring(text: str) -> str:
    """Return a text of several lines as a Python string in triple quotes."""
    kept = (f"\\{c}" if c in '"\\' else c if c == "\n" or c.isprintable() else repr(c)[1:-1] for c in text)
    return f'"""{"".join(kept)}"""'


def modelica_string(text: str) -> str:
    r"""Return a text as a Modelica string.

    >>> print(modelica_string('a"b\\c'))
    "a\"b\\c"
    """
    return f'"{"".join(_MODELICA_ESCAPES.get(c, c) for c in _writable(text))}"'


def modelica_path(name: str) -> str:
    """Return a model's name in Modelica; in single quotes unless it is a path of plain identifiers.

    >>> modelica_path("Cars.AT"), modelica_path("x); system(1")
    ('Cars.AT', "'x); system(1'")
    """
    if _MODELICA_PATH.fullmatch(name):
        return name
    return f"'{''.join(_MODELICA_ESCAPES.get(c, c) for c in _writable(name))}'"


def toml_key(name: str) -> str:
    """Return a name as TOML writes it between dots: ``ba[2]`` in double quotes."""
    from tomlkit import key  # takes long

    return key(name).as_string()


def csv_cell(text: str) -> str:
    """Return the content of a CSV cell that spreadsheets show as text or as a number, never run as a formula.

    Quotes and commas are up to the csv module.

    >>> csv_cell("=1+2"), csv_cell("-0.5"), csv_cell("AT1")
    ("'=1+2", '-0.5', 'AT1')
    """
    cell = plain(text)
    return f"'{cell}" if cell.startswith(_FORMULA_STARTS) and not _NUMBER.fullmatch(cell) else cell


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    r"""Return a table as comma-separated values; cells that are None are empty.

    >>> csv_text([["time", "a,b"], [0.5, None]])
    'time,"a,b"\n0.5,\n'
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows(["" if cell is None else csv_cell(str(cell)) for cell in row] for row in rows)
    return text.getvalue()


def markdown_text(text: str) -> str:
    r"""Return a text as one line of Markdown without markup, also within a table.

    >>> print(markdown_text("a|b <img> _x_ the_mass $m$"))
    a\|b \<img> \_x\_ the_mass \$m\$
    """
    return re.sub(r"([\\`*\[\]<|~$]|(?<![^\W_])_|_(?![^\W_]))", r"\\\1", one_line(text))


def markdown_code(text: str) -> str:
    """Return a text as code within a line of Markdown.

    >>> markdown_code("a `b`")
    '`` a `b` ``'
    """
    line = one_line(text)
    longest = max(map(len, re.findall("`+", line)), default=0)
    return f"`{line}`" if not longest else f"{'`' * (longest + 1)} {line} {'`' * (longest + 1)}"


def digits(value: float) -> int:
    """Return the number of significant decimal digits of a number.

    >>> digits(100.0), digits(0.05), digits(33.25)
    (1, 1, 4)
    """
    return len(Decimal(repr(float(value))).normalize().as_tuple().digits) if value else 1


def shortest(value: float) -> str:
    """Return a number with the fewest digits that have its value.

    >>> shortest(1.1), shortest(2.0), shortest(1e-7)
    ('1.1', '2', '1e-07')
    """
    return repr(float(value)).removesuffix(".0")


def number_in(said: float | str) -> float | None:
    """Return the finite number that somebody gave, or whose text somebody typed; None for other texts."""
    try:
        number = float(said)
    except ValueError:
        return None
    return number if isfinite(number) else None


def _writable(text: str) -> str:
    return _UNWRITABLE.sub(_REPLACEMENT, text)
