"""What decided a robustness value: the way from a formula down to one predicate at one sample.

At each operator the way goes to the operand whose value became the operator's value. Ties go to the earliest
sample and to the left operand; ``or`` and ``->`` are read as their negated conjunctions, which gives the left
operand too.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.stl.formula import (
    Always,
    And,
    Eventually,
    Formula,
    Iff,
    Implies,
    Next,
    Not,
    Or,
    Predicate,
    Until,
)
from falsifier.stl.program import Program, window_samples


@dataclass(frozen=True, slots=True)
class Waypoint:
    """One formula on the way.

    Attributes:
        formula: the formula.
        sample: where its value was asked for.
        value: its robustness there.
        window: first and last sample that its operator looked at; None without a window.
    """

    formula: Formula
    sample: int
    value: float
    window: tuple[int, int] | None = None


def trace(program: Program, buffer: NDArray[np.float64], sample: int = 0) -> list[Waypoint]:
    """Way from the program's formula at this sample to the predicate that decided its value.

    Args:
        program: the compiled formula.
        buffer: after the kernels filled it.
        sample: where the formula's value is asked for.
    """
    values = Values(program, buffer)
    way: list[Waypoint] = []
    formula: Formula | None = program.formula
    while formula is not None:
        window = values.window(formula, sample)
        way.append(Waypoint(formula, sample, values.at(formula, sample), window))
        formula, sample = _decider(values, formula, sample, window)
    return way


@dataclass(frozen=True, slots=True)
class Values:
    """Values of the parts of a formula after an evaluation."""

    program: Program
    buffer: NDArray[np.float64]

    def at(self, formula: Formula, sample: int) -> float:
        """Robustness of a sub-formula at a sample."""
        return float(self.buffer[self.program.places[formula].base + sample])

    def over(self, formula: Formula, first: int, last: int) -> NDArray[np.float64]:
        """Robustness of a sub-formula at the samples from first to last."""
        base = self.program.places[formula].base
        return self.buffer[base + first : base + last + 1]

    def window(self, formula: Formula, sample: int) -> tuple[int, int] | None:
        """First and last sample that a temporal operator looks at from here."""
        if not isinstance(formula, Always | Eventually | Until):
            return None
        if formula.window is None:
            return sample, self.program.samples - 1
        start, end = window_samples(formula.window, self.program.step)
        return sample + start, sample + end


def _decider(
    values: Values, formula: Formula, sample: int, window: tuple[int, int] | None
) -> tuple[Formula | None, int]:
    match formula:
        case Predicate():
            return None, sample
        case Not(operand):
            return operand, sample
        case Next(operand):
            return operand, sample + 1
        case And(left, right):
            return (left if values.at(left, sample) <= values.at(right, sample) else right), sample
        case Or(left, right):
            return (left if values.at(left, sample) >= values.at(right, sample) else right), sample
        case Implies(left, right):
            return (left if -values.at(left, sample) >= values.at(right, sample) else right), sample
        case Iff(left, right):
            return _decider_of_iff(values, left, right, sample), sample
        case Always(operand) if window:
            return operand, window[0] + int(values.over(operand, *window).argmin())
        case Eventually(operand) if window:
            return operand, window[0] + int(values.over(operand, *window).argmax())
        case Until(left, right) if window:
            return _decider_of_until(values, left, right, sample, window)
    raise TypeError(f"not a formula: {formula!r}")


def _decider_of_iff(values: Values, left: Formula, right: Formula, sample: int) -> Formula:
    a, b = values.at(left, sample), values.at(right, sample)
    forward, backward = max(-a, b), max(-b, a)
    if forward <= backward:
        return left if -a >= b else right
    return right if -b >= a else left


def _decider_of_until(
    values: Values, left: Formula, right: Formula, sample: int, window: tuple[int, int]
) -> tuple[Formula, int]:
    """Left at its smallest up to the best end of the window where that is the smaller, else right there."""
    first, last = window
    lefts = values.over(left, sample, last)
    lowest = np.minimum.accumulate(lefts)[first - sample :]
    rights = values.over(right, first, last)
    best = int(np.minimum(lowest, rights).argmax())
    if lowest[best] < rights[best]:
        return left, sample + int(lefts[: first - sample + best + 1].argmin())
    return right, first + best
