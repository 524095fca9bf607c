"""What must fail together, or for long, so that a requirement is violated; how close a sample came."""

from collections.abc import Iterator, Mapping, Sequence
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from falsifier.core.words import listed
from falsifier.llm.prompts.courses import Array, longest_stretch
from falsifier.stl import Formula
from falsifier.stl.formula import Always, And, Eventually, Implies, Not, Or
from falsifier.stl.margins import shown

# Near misses that are told, by what was missing.
_MOST_MISSES = 4
# Samples that are listed as those in which one of what must happen together did.
_MOST_NEAREST = 4


class Side(NamedTuple):
    """One of what must hold, or fail, at one time so that a requirement is violated."""

    part: Formula
    must_hold: bool

    def __str__(self) -> str:
        return f"{self.part} {'holds' if self.must_hold else 'fails'}"


class NearMiss(NamedTuple):
    """When a violation was nearest while most did what they must do together, but not all."""

    met: tuple[Side, ...]
    missing: tuple[Side, ...]
    sample: int


class Recurrence(NamedTuple):
    """What a requirement is violated by if it fails for long in one piece."""

    condition: Formula
    length: float  # in s, for which it must fail
    start: float  # first time in s at which that counts
    end: float  # and the last one


def at_one_time(side: Side) -> Side:
    """What must hold, or fail, at some time so that a formula does.

    >>> from falsifier.stl import parse
    >>> str(at_one_time(Side(parse("G not F[0,3] (x >= 2)"), must_hold=False)))
    'x >= 2 holds'
    """
    formula, must_hold = side
    while isinstance(formula, Not | (Eventually if must_hold else Always)):
        must_hold, formula = must_hold != isinstance(formula, Not), formula.operand
    return Side(formula, must_hold)


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


def closest(formula: Formula, over_time: Mapping[Formula, Array]) -> dict[Side, float]:
    """How far each of what must happen together was off at best, below 0 if it did; empty for one thing."""
    inner = at_one_time(Side(formula, must_hold=False))
    sides, margins, _ = _margins(inner, over_time)
    return dict(zip(sides, margins.min(axis=1).tolist(), strict=True)) if len(sides) > 1 else {}


def apart(samples: Mapping[int, Mapping[Side, float]]) -> str:
    """In which samples, by number, each of what must happen together did, as ``closest`` tells of each.

    Empty if one sample was the nearest in all of it: its robustness tells as much.
    """
    words, found = [], set(samples)
    for side in next(iter(samples.values()), ()):
        off = {number: closest[side] for number, closest in samples.items()}
        least = max(min(off.values()), 0.0)
        nearest = [number for number in off if off[number] <= least]
        found &= set(nearest)
        where = f"sample{'s' * (len(nearest) > 1)} {listed([*map(str, nearest[:_MOST_NEAREST])])}"
        if len(nearest) > _MOST_NEAREST:
            where = f"{len(nearest)} samples, first in sample {nearest[0]}"
        words.append(
            f"{side} in {where}" if least == 0 else f"{side} in none, off by {shown(least):.4g} in {where}"
        )
    return f"Of what a violation needs together: {'; '.join(words)}." if words and not found else ""


def came_nearer(last: Sequence[Mapping[Side, float]], before: Sequence[Mapping[Side, float]]) -> bool:
    """Whether samples came nearer to something that must happen than those before, by ``closest`` of each."""
    sides = set(last[0]).intersection(*last, *before)
    nearest = ((min(max(s[side], 0.0) for s in part) for part in (last, before)) for side in sides)
    return any(now < then for now, then in nearest)


def near_misses(side: Side, times: Array, over_time: Mapping[Formula, Array]) -> Iterator[NearMiss]:
    """When as many as ever, but not all, did what they must do together: once for each of those that did not.

    Nothing of those that did so at all times: what was missing then is told without them. Of equally near
    times, that at which what a missing window asks for was least far away. What never did what it must is
    looked at in the same way.
    """
    sides, margins, asked = _margins(at_one_time(side), over_time)
    is_met = margins < 0
    is_always_met = np.asarray(is_met.all(axis=1))
    counts = is_met.sum(axis=0)
    most = int(counts.max())
    if most == len(sides):
        return
    for met in np.unique(is_met[:, counts == most], axis=1).T[::-1][:_MOST_MISSES]:
        if is_always_met[met].all():  # or none is met
            continue
        where = np.flatnonzero((is_met == met[:, None]).all(axis=0))
        done = tuple(one for one, so in zip(sides, met.tolist(), strict=True) if so)
        missing = tuple(one for one in sides if one not in done)
        worst = margins[~met][:, where].max(axis=0)
        nearest = asked[where[worst == worst.min()]]
        gaps = [asked_for(one, times, over_time, nearest)[0] for one in missing]
        yield NearMiss(done, missing, int(nearest[np.sum(gaps, axis=0).argmin()]))
    for one, margin in zip(sides, margins, strict=True):
        if not (margin < 0).any() and at_one_time(one) != one:
            yield from near_misses(one, times, over_time)


def asked_for(
    side: Side, times: Array, over_time: Mapping[Formula, Array], samples: NDArray[np.intp]
) -> tuple[Array, Array]:
    """How far in s what a missing window asks for was from the window, seen from samples; and when it was.

    Both are 0 where a side has no window, and infinite where what it asks for never was.
    """
    part, must_hold = side
    if not isinstance(part, Eventually if must_hold else Always):
        return np.zeros(len(samples)), np.zeros(len(samples))
    margin = over_time[part.operand]
    found = np.concatenate(([-inf], times[margin >= 0 if must_hold else margin < 0], [inf]))
    start, end = (part.window.start, part.window.end) if part.window else (0.0, float(times[-1]))
    first = np.searchsorted(found, times[samples] + start)
    before, after = found[first - 1], found[first]
    early, late = times[samples] + start - before, after - times[samples] - end
    return np.minimum(early, late), np.where(early < late, before, after)


def _margins(side: Side, over_time: Mapping[Formula, Array]) -> tuple[list[Side], Array, NDArray[np.intp]]:
    """What must happen together, how far each is off, shape (sides, n), and the samples where it counts."""
    sides = list(_divided(side))
    asked = np.flatnonzero(~np.isnan(over_time[side.part]))  # a part may be asked for elsewhere, too
    return sides, np.array([over_time[p][asked] * (-1 if must_hold else 1) for p, must_hold in sides]), asked


def _divided(side: Side) -> Iterator[Side]:
    part, must_hold = side
    match part:
        case Not():
            yield from _divided(Side(part.operand, must_hold=not must_hold))
        case Implies() if not must_hold:
            condition, consequence = part.children
            yield from _divided(Side(condition, must_hold=True))
            yield from _divided(Side(consequence, must_hold=False))
        case And() | Or() if must_hold == isinstance(part, And):
            for child in part.children:
                yield from _divided(Side(child, must_hold=must_hold))
        case _:
            yield side
