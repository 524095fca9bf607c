"""The order of simplicity: which of two candidates is easier to understand.

The first criterion that differs decides:

1. fewer distinct values, summed over the signals;
2. fewer changes of value over time;
3. fewer signals that ever leave rest, and fewer parameters that differ from nominal;
4. fewer control points; then ``constant`` before ``linear`` before ``pchip``;
5. rounder numbers: rest and nominal, then a bound of the range, then numbers with few digits;
6. closer to rest and nominal, as a share of the range on its scale; finally the numbers themselves, so that
   the order is total: two candidates with equal keys give equal simulations.
"""

from collections.abc import Iterator
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Decimal

from falsifier.core.candidate import Candidate
from falsifier.core.literals import digits
from falsifier.core.ranges import InputRange, ParameterRange, Range
from falsifier.core.signals import Interpolation
from falsifier.problem.problem import Problem

Key = tuple[object, ...]

_SIMPLEST_FIRST: tuple[Interpolation, ...] = ("constant", "linear", "pchip")


def rest_value(problem: Problem, ranged: Range) -> float | None:
    """Rest value of an input, or nominal value of a parameter; None if unknown.

    The rest value of an input is the model's start value, or 0 if that is unknown or outside the range. The
    nominal value of a parameter is the model's own value.
    """
    if isinstance(ranged, ParameterRange):
        known = ranged.nominal
    else:
        known = problem.info[ranged.name].start_number if ranged.name in problem.info else None
    if known is not None and ranged.low <= known <= ranged.high:
        return known
    return 0.0 if isinstance(ranged, InputRange) and ranged.low <= 0.0 <= ranged.high else None


def simplicity(problem: Problem, candidate: Candidate) -> Key:
    """Sort key: the simpler of two candidates has the smaller one."""
    signals = [(r, candidate.signals[r.name]) for r in problem.space.inputs]
    parameters = [(p, candidate.parameters[p.name]) for p in problem.space.parameters]
    numbers = [(r, v) for r, s in signals for v in sorted(set(s.values))] + parameters
    rests = {ranged.name: rest_value(problem, ranged) for ranged in problem.space.ranges}
    distances = [r.share_of(v) - r.share_of(x) for r, v in numbers if (x := rests[r.name]) is not None]
    return (
        sum(len(set(s.values)) for _, s in signals),
        sum(s.switches for _, s in signals),
        sum(any(v != rests[r.name] for v in s.values) for r, s in signals)
        + sum(v != rests[p.name] for p, v in parameters),
        sum(len(s.times) for _, s in signals),
        sum(_SIMPLEST_FIRST.index(s.interpolation) for _, s in signals),
        sum(_roughness(r, v, rests[r.name]) for r, v in numbers)
        + sum(digits(t) for r, s in signals if not problem.space.is_fixed(r, s) for t in s.times),
        # Without the digits of rounding, which would tell apart what is equally far on both sides.
        round(sum(map(abs, distances)), 12),
        tuple((s.times, s.values, s.interpolation) for _, s in signals),
        tuple(v for _, v in parameters),
    )


def rounder(value: float) -> Iterator[float]:
    """Yield numbers close to this one with fewer digits, the roundest and nearest first.

    >>> list(rounder(33.25))[:4]
    [30.0, 40.0, 33.0, 34.0]
    """
    exact = Decimal(repr(float(value)))  # numpy's numbers have another one
    seen = {value}
    for count in range(1, digits(value)):
        last_place = Decimal((0, (1,), exact.adjusted() - count + 1))
        for rounding in (ROUND_HALF_EVEN, ROUND_FLOOR, ROUND_CEILING):
            new = float(exact.quantize(last_place, rounding=rounding))
            if new not in seen:
                seen.add(new)
                yield new


def _roughness(ranged: InputRange | ParameterRange, value: float, rest: float | None) -> int:
    if value == rest:
        return 0
    return 1 if value in (ranged.low, ranged.high) else 1 + digits(value)
