"""What decided a robustness value: the path from a formula down to one predicate at one sample.

At each operator the path continues with the operand whose value became the operator's value. Ties go to the
earliest sample and the left operand; ``or`` and ``->`` are treated as negated conjunctions, so their ties go
to the left operand too. For until, too, the path goes to the left operand if both are equal.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from falsifier.stl.formula import Always, And, Eventually, Formula, Iff, Implies, Next, Not, Or, Until
from falsifier.stl.program import Part

Floats = NDArray[np.float64]


class Waypoint(NamedTuple):
    """One sub-formula on the path.

    Attributes:
        part: the compiled sub-formula.
        sample: sample at which it was evaluated.
        value: its robustness at that sample.
        window: first and last sample of its operator's window; None if it has no window.
    """

    part: Part
    sample: int
    value: float
    window: tuple[int, int] | None


def path_to_decider(part: Part, buffer: Floats, sample: int = 0) -> list[Waypoint]:
    """Return the path from a compiled formula at this sample to the predicate that decided its value.

    Args:
        part: the compiled formula.
        buffer: values of all parts, filled by the kernels.
        sample: sample at which the formula was evaluated.
    """
    path: list[Waypoint] = []
    while True:
        window = part.window_at(sample)
        path.append(Waypoint(part, sample, part.at(buffer, sample), window))
        if not part.children:
            return path
        part, sample = _decider(part, buffer, sample, window)


def _decider(part: Part, buffer: Floats, sample: int, window: tuple[int, int] | None) -> tuple[Part, int]:
    kind, children = type(part.formula), part.children
    if kind is Not:
        return children[0], sample
    if kind is Next:
        return children[0], sample + 1
    if window is not None and kind is Always:
        return children[0], window[0] + int(children[0].over(buffer, *window).argmin())
    if window is not None and kind is Eventually:
        return children[0], window[0] + int(children[0].over(buffer, *window).argmax())
    if window is not None and kind is Until:
        return _decider_of_until(part, buffer, sample, window)
    return children[_side(kind, *(child.at(buffer, sample) for child in children))], sample


def _side(kind: type[Formula], left: float, right: float) -> int:
    """Return which operand decided: 0 for the left one, 1 for the right one."""
    if kind is And:
        return int(left > right)
    if kind is Or:
        return int(left < right)
    if kind is Implies:
        return int(-left < right)
    if kind is Iff:
        is_forward = max(-left, right) <= max(-right, left)
        return int(-left < right) if is_forward else int(-right >= left)
    raise TypeError(f"{kind.__name__} has no two sides")


def _decider_of_until(part: Part, buffer: Floats, sample: int, window: tuple[int, int]) -> tuple[Part, int]:
    first, last = window
    left, right = part.children
    lefts = left.over(buffer, sample, last)
    lowest = np.minimum.accumulate(lefts)[first - sample :]
    rights = right.over(buffer, first, last)
    best = int(np.minimum(lowest, rights).argmax())
    if lowest[best] <= rights[best]:
        return left, sample + int(lefts[: first - sample + best + 1].argmin())
    return right, first + best
