"""Margins exactly on the limit: their sign says whether the comparison holds there; and margins as text."""

from math import copysign

from falsifier.core.words import readable
from falsifier.stl.formula import Comparison, Predicate
from falsifier.stl.parser import parse

# Size of a robustness that is exactly on the limit: its sign says whether the formula holds there. It is far
# below what any difference of two numbers of a simulation can be, and far above the smallest number.
ON_LIMIT = 1e-300


def on_limit(operator: Comparison) -> float:
    """Return the robustness of a comparison whose two sides are equal."""
    return ON_LIMIT if operator in ("<=", ">=", "==") else -ON_LIMIT


def is_on_limit(robustness: float) -> bool:
    """Whether a margin is exactly 0.

    >>> is_on_limit(on_limit("<")), is_on_limit(0.1)
    (True, False)
    """
    return abs(robustness) < 10 * ON_LIMIT  # also a difference of two such margins


def signed(robustness: float | None, digits: int | None = None) -> str:
    """Return a robustness with its sign, as it is shown; exactly on the limit it is -0 or +0.

    Without a robustness, as of a simulation that failed, it is unknown. It has as many digits as ``readable``
    shows, or no more than are stated.

    >>> signed(0.41874, 3), signed(-12.0), signed(on_limit("<")), signed(-86399.95)
    ('+0.419', '-12', '-0', '-86399.95')
    """
    if robustness is None:
        return "unknown"
    return f"{shown(robustness):+.{digits}g}" if digits else readable(shown(robustness), sign="+")


def shown(robustness: float) -> float:
    """Return the number to show for a robustness: exactly on the limit, 0 with its sign."""
    return copysign(0.0, robustness) if is_on_limit(robustness) else robustness


def margin_words(robustness: float, predicate: str = "") -> str:
    """Say what a robustness means; the predicate that decided it counts exactly on the limit.

    >>> margin_words(-0.5), margin_words(0.5)
    ('violated by this margin', 'holds with this margin; below 0 is a violation')
    >>> margin_words(on_limit(">"), "load > 0")
    'violated: exactly on the limit, which > does not allow'
    >>> margin_words(on_limit(">"), "gear == 3")  # a condition: what followed from it failed
    'violated, by a margin of 0: gear == 3 holds exactly on its limit'
    """
    if not is_on_limit(robustness):
        return (
            "violated by this margin" if robustness < 0 else "holds with this margin; below 0 is a violation"
        )
    if robustness > 0:
        return "holds: exactly on the limit, which is allowed"
    comparison = parse(predicate) if predicate else None
    if not isinstance(comparison, Predicate):
        return "violated: exactly on the limit"
    if on_limit(comparison.operator) < 0:
        return f"violated: exactly on the limit, which {comparison.operator} does not allow"
    # It is under a negation, or the condition of what failed.
    return f"violated, by a margin of 0: {predicate} holds exactly on its limit"
