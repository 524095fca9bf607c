"""Formulas in words, for prompts and reports."""

from falsifier.core.literals import shortest
from falsifier.stl import formula as stl
from falsifier.stl.expression import Arithmetic, Call, Number

_IS: dict[stl.Comparison, str] = {
    "<": "is below",
    "<=": "is at most",
    ">": "is above",
    ">=": "is at least",
    "==": "equals",
    "!=": "differs from",
}
_BY = {"<": "less than", ">": "more than", ">=": "at least"}


def in_words(formula: stl.Formula) -> str:
    """Return one sentence that states what a formula requires.

    >>> from falsifier.stl import parse
    >>> print(in_words(parse("G[0,20] (speed <= 120)")))
    At all times from 0 to 20 s, speed is at most 120.
    """
    text = _read(formula, later=False)
    starts_with_word = text.startswith(("at ", "if ", "it "))  # not with a signal, whose case matters
    return f"{text[0].upper() + text[1:] if starts_with_word else text}."


def _read(formula: stl.Formula, *, later: bool) -> str:
    """Put a formula into words, with absolute times or, if ``later``, relative to an enclosing operator."""
    match formula:
        case stl.Predicate():
            return _predicate(formula)
        case stl.Not(stl.Flag(left=signal)):
            return f"{signal} is false"
        case stl.Not(stl.Predicate()):
            return _read(stl.negated(formula.operand), later=later)
        case stl.Not(operand):
            return f"it is not the case that {_part(operand, later=later)}"
        case stl.And(stl.Predicate() as low, stl.Predicate() as high) if _is_range(formula):
            return f"{low.right} is between {low.left} and {high.right}"
        case stl.And(left, right):
            return (
                f"{_part(left, later=later, within=stl.And)} and {_part(right, later=later, within=stl.And)}"
            )
        case stl.Or(left, right):
            return f"{_part(left, later=later, within=stl.Or)} or {_part(right, later=later, within=stl.Or)}"
        case stl.Implies(left, right):
            return f"if {_condition(left, later=later)}, then {_read(right, later=later)}"
        case stl.Iff(left, right):
            return f"{_part(left, later=later)} exactly when {_part(right, later=later)}"
        case stl.Always(operand, window):
            return f"{_when(window, later=later, always=True)}, {_read(operand, later=True)}"
        case stl.Eventually(operand, window):
            return f"{_when(window, later=later)}, {_read(operand, later=True)}"
        case stl.Until(left, right, window):
            end = _when(window, later=later)
            return f"{_part(left, later=True)} until, {end}, {_part(right, later=True)}"
        case stl.Next(operand):
            return f"at the next recorded time, {_read(operand, later=True)}"
    raise TypeError(f"not a formula: {formula!r}")


def _condition(formula: stl.Formula, *, later: bool) -> str:
    is_closed = not any(isinstance(f, stl.Implies | stl.Iff | stl.Until) for f in formula.walk())
    return _read(formula, later=later) if is_closed else _part(formula, later=later)


def _part(formula: stl.Formula, *, later: bool, within: type[stl.Formula] | None = None) -> str:
    """Put an operand into words, in parentheses if its end could otherwise be misread."""
    text = _read(formula, later=later)
    is_short = isinstance(formula, stl.Predicate) or (
        isinstance(formula, stl.Not) and isinstance(formula.operand, stl.Predicate)
    )
    is_same = within is not None and isinstance(formula, within)
    return text if is_short or is_same or _is_range(formula) else f"({text})"


def _is_range(formula: stl.Formula) -> bool:
    match formula:
        case stl.And(stl.Predicate("<=", _, middle), stl.Predicate("<=", again, _)):
            return middle == again
    return False


def _predicate(predicate: stl.Predicate) -> str:
    left, operator, right = predicate.left, predicate.operator, predicate.right
    if isinstance(predicate, stl.Flag):
        return f"{left} is true"
    if isinstance(left, Number) and not isinstance(right, Number):
        left, operator, right = right, stl.MIRRORED[operator], left
    match left, operator:
        case Call("abs", (Arithmetic("-", a, b),)), "<=":
            return f"{a} is within {right} of {b}"
        case Call("abs", (Arithmetic("-", a, b),)), "<" | ">" | ">=":
            return f"{a} differs from {b} by {_BY[operator]} {right}"
    return f"{left} {_IS[operator]} {right}"


def _when(window: stl.Window | None, *, later: bool, always: bool = False) -> str:
    """Say at which times an operand must hold: always within a window, or at some time."""
    absolute, open_ended, soon = (
        ("at all times", "from then on", "throughout")
        if always
        else ("at some time", "at some time from then on", "at some time within")
    )
    if window is None:
        return open_ended if later else absolute
    start, end = shortest(window.start), shortest(window.end)
    if start == end:
        return f"{start} s later" if later else f"at {start} s"
    if later and window.start == 0:
        return f"{soon} the next {end} s"
    return f"{absolute} from {start} to {end} s{' later' if later else ''}"
