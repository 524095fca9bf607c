"""How far the parts of a formula came on a trajectory: the data from which a whole search is judged."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.stl.formula import Formula, Implies, Or, Predicate
from falsifier.stl.program import Part


@dataclass(frozen=True, slots=True)
class Watched:
    """A part of a formula whose extremes are of interest.

    Attributes:
        formula: the implication or disjunction to which the part belongs; for a predicate itself.
        part: the condition of an implication, an operand of a disjunction, or a predicate.
        first: first sample at which it counts.
        last: last sample.
    """

    formula: Formula
    part: Part
    first: int
    last: int


@dataclass(frozen=True, slots=True, eq=False)
class Extremes:
    """Smallest and largest robustness of the watched parts over all samples at which they count.

    Attributes:
        lows: smallest robustness, shape (k,).
        highs: largest robustness, shape (k,).
        lowest: time in s of the smallest, shape (k,).
        highest: time in s of the largest, shape (k,).
    """

    lows: NDArray[np.float64]
    highs: NDArray[np.float64]
    lowest: NDArray[np.float64]
    highest: NDArray[np.float64]


def extremes_of(parts: tuple[Watched, ...], buffer: NDArray[np.float64], step: float) -> Extremes:
    """Return the extremes of the watched parts on an evaluated trajectory.

    Args:
        parts: the parts.
        buffer: values of all parts of the formula.
        step: sampling step in s.
    """
    lows, highs, lowest, highest = np.empty((4, len(parts)))
    for i, watched in enumerate(parts):
        values = watched.part.over(buffer, watched.first, watched.last)
        low, high = int(values.argmin()), int(values.argmax())
        lows[i], highs[i] = values[low], values[high]
        lowest[i], highest[i] = (watched.first + low) * step, (watched.first + high) * step
    return Extremes(lows, highs, lowest, highest)


def watched_parts(root: Part) -> tuple[Watched, ...]:
    """Return the conditions of implications, the operands of disjunctions, and the predicates."""
    return tuple(_watched(root))


def _watched(root: Part) -> Iterator[Watched]:
    for part in root.walk():
        place = part.place
        match part.formula:
            case Implies():
                yield Watched(part.formula, part.children[0], place.first, place.last)
            case Or():
                for child in part.children:
                    yield Watched(part.formula, child, place.first, place.last)
            case Predicate():
                yield Watched(part.formula, part, place.first, place.last)
