"""Formulas in words, for prompts and reports."""

from falsifier.stl.expression import Arithmetic, Call, Number, number_text
from falsifier.stl.formula import (
    MIRRORED,
    Always,
    And,
    Comparison,
    Eventually,
    Flag,
    Formula,
    Iff,
    Implies,
    Next,
    Not,
    Or,
    Predicate,
    Until,
    Window,
    negated,
)

_IS: dict[Comparison, str] = {
    "<": "is below",
    "<=": "is at most",
    ">": "is above",
    ">=": "is at least",
    "==": "equals",
    "!=": "differs from",
}


def in_words(formula: Formula) -> str:
    """Return one sentence that states what a formula requires.

    >>> from falsifier.stl import parse
    >>> print(in_words(parse("G[0,20] (speed <= 120)")))
    At all times from 0 to 20 s, speed is at most 120.
    """
    text = _read(formula, later=False)
    starts_with_word = text.startswith(("at ", "if ", "it "))  # not with a signal, whose case matters
    return f"{text[0].upper() + text[1:] if starts_with_word else text}."


def _read(formula: Formula, *, later: bool) -> str:
    """Put a formula into words, with absolute times or, if ``later``, relative to an enclosing operator."""
    match formula:
        case Predicate():
            return _predicate(formula)
        case Not(Flag(left=signal)):
            return f"{signal} is false"
        case Not(Predicate()):
            return _read(negated(formula.operand), later=later)
        case Not(operand):
            return f"it is not the case that {_part(operand, later=later)}"
        case And(Predicate() as low, Predicate() as high) if _is_range(formula):
            return f"{low.right} is between {low.left} and {high.right}"
        case And(left, right):
            return f"{_part(left, later=later, within=And)} and {_part(right, later=later, within=And)}"
        case Or(left, right):
            return f"{_part(left, later=later, within=Or)} or {_part(right, later=later, within=Or)}"
        case Implies(left, right):
            return f"if {_condition(left, later=later)}, then {_read(right, later=later)}"
        case Iff(left, right):
            return f"{_part(left, later=later)} exactly when {_part(right, later=later)}"
        case Always(operand, window):
            return f"{_when(window, later=later, always=True)}, {_read(operand, later=True)}"
        case Eventually(operand, window):
            return f"{_when(window, later=later)}, {_read(operand, later=True)}"
        case Until(left, right, window):
            end = _when(window, later=later).replace("at some time ", "")
            return f"{_part(left, later=True)} until, {end}, {_part(right, later=True)}"
        case Next(operand):
            return f"at the next recorded time, {_read(operand, later=True)}"
    raise TypeError(f"not a formula: {formula!r}")


def _condition(formula: Formula, *, later: bool) -> str:
    is_closed = not any(isinstance(f, Implies | Iff | Until) for f in formula.walk())
    return _read(formula, later=later) if is_closed else _part(formula, later=later)


def _part(formula: Formula, *, later: bool, within: type[Formula] | None = None) -> str:
    """Put an operand into words, in parentheses if its end could otherwise be misread."""
    text = _read(formula, later=later)
    is_short = isinstance(formula, Predicate) or (
        isinstance(formula, Not) and isinstance(formula.operand, Predicate)
    )
    is_same = within is not None and isinstance(formula, within)
    return text if is_short or is_same or _is_range(formula) else f"({text})"


def _is_range(formula: Formula) -> bool:
    match formula:
        case And(Predicate("<=", _, middle), Predicate("<=", again, _)):
            return middle == again
    return False


def _predicate(predicate: Predicate) -> str:
    left, operator, right = predicate.left, predicate.operator, predicate.right
    if isinstance(predicate, Flag):
        return f"{left} is true"
    if isinstance(left, Number) and not isinstance(right, Number):
        left, operator, right = right, MIRRORED[operator], left
    match left, operator:
        case Call("abs", (Arithmetic("-", a, b),)), "<" | "<=":
            return f"{a} is within {right} of {b}"
        case Call("abs", (Arithmetic("-", a, b),)), ">" | ">=":
            least = "more than" if operator == ">" else "at least"
            return f"{a} differs from {b} by {least} {right}"
    return f"{left} {_IS[operator]} {right}"


def _when(window: Window | None, *, later: bool, always: bool = False) -> str:
    """Say at which times an operand must hold: always within a window, or at some time."""
    absolute, open_ended, soon = (
        ("at all times", "from then on", "throughout")
        if always
        else ("at some time", "at some later time", "at some time within")
    )
    if window is None:
        return open_ended if later else absolute
    start, end = number_text(window.start), number_text(window.end)
    if start == end:
        return f"{start} s later" if later else f"at {start} s"
    if later and window.start == 0:
        return f"{soon} the next {end} s"
    return f"{absolute} from {start} to {end} s{' later' if later else ''}"
