"""What must fail together, or for long, so that a requirement is violated; how close a sample came."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from falsifier.llm.prompts.courses import Array, longest_stretch
from falsifier.stl import Formula
from falsifier.stl.diagnosis import links
from falsifier.stl.formula import Always, Eventually, Implies, Or


class NearMiss(NamedTuple):
    """When the others were closest to failing while one of those failed that must fail together."""

    while_so: str  # what failed, or held if it is the condition of an implication
    sample: int
    others: tuple[Formula, ...]


class Recurrence(NamedTuple):
    """What a requirement is violated by if it fails for long in one piece."""

    condition: Formula
    length: float  # in s, for which it must fail
    start: float  # first time in s at which that counts
    end: float  # and the last one


def inside_always(formula: Formula) -> Formula:
    """What must hold at all times."""
    while isinstance(formula, Always):
        formula = formula.operand
    return formula


def recurring(formula: Formula) -> Recurrence | None:
    """What must be true again and again; None if nothing must."""
    inner, start, end = formula, 0.0, 0.0
    while isinstance(inner, Always) and inner.window:
        start, end, inner = start + inner.window.start, end + inner.window.end, inner.operand
    if isinstance(inner, Eventually) and (window := inner.window) and inner is not formula:
        return Recurrence(inner.operand, window.end - window.start, start + window.start, end + window.end)
    return None


def longest_failure(
    formula: Formula, times: Array, over_time: Mapping[Formula, Array]
) -> tuple[float, float] | None:
    """First and last time in s of the longest failure of what must recur; None if nothing must, or it did."""
    found = recurring(formula)
    return None if found is None else longest_stretch(times, over_time[found.condition] < 0)


def near_misses(formula: Formula, over_time: Mapping[Formula, Array]) -> Iterator[NearMiss]:
    """The near miss for each of those that must fail together and failed, but not all the time."""
    inner = inside_always(formula)
    if isinstance(inner, Or):
        sides = [(side, f"{side} fails", over_time[side]) for side in links(inner)]
    elif isinstance(inner, Implies):
        condition, consequence = inner.children
        sides = [
            (condition, f"{condition} holds", -over_time[condition]),
            (consequence, f"{consequence} fails", over_time[consequence]),
        ]
    else:
        return
    margins = np.array([margin for _, _, margin in sides])
    for k, (_, while_so, margin) in enumerate(sides):
        others = np.delete(margins, k, axis=0).max(axis=0)
        where = np.flatnonzero((margin < 0) & ~np.isnan(others))
        if len(where) and (margin[~np.isnan(margin)] >= 0).any():
            rest = tuple(side for i, (side, _, _) in enumerate(sides) if i != k)
            yield NearMiss(while_so, int(where[others[where].argmin()]), rest)
