"""Names of FMU variables in formulas.

Most names need no quotes: ``speed``, ``a.b[1]``, ``x[1,2]``, ``der(x)``, and Modelica names whose single
quotes are part of the name: ``car.'front left'.v``. Any other name is written in double quotes, which are not
part of it: ``"G"``, ``"wheel speed"``.
"""

import re

FUNCTIONS = ("abs", "sqrt", "exp", "log", "sin", "cos", "min", "max")
TEMPORAL = ("G", "F", "U", "X", "always", "eventually", "until", "next")
RESERVED = frozenset((*TEMPORAL, "not", "and", "or", "true", "false"))

_IDENTIFIER = r"(?:[^\W\d]|\$)[\w$]*"
_PART = rf"(?:{_IDENTIFIER}|'(?:[^'\\\n]|\\.)+')(?:\[ *\d+(?: *, *\d+)* *\])?"
_PATH = rf"{_PART}(?:\.{_PART})*"
_WORD_PATTERN = re.compile(rf"({_IDENTIFIER})(?!\.)")
_PATH_PATTERN = re.compile(_PATH)
_DERIVATIVE = re.compile(r"der\(\s*")
_DERIVATIVE_END = re.compile(r"\s*(,\s*\d+)?\s*\)")
_QUOTED_PATTERN = re.compile(r'"((?:[^"\\]|\\.)+)"', re.DOTALL)


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
        return path[0].replace(" ", "") if "'" not in path[0] else path[0], path.end()
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
