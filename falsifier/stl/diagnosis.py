"""Critical time and diagnosis: when and by what a robustness was decided, in words and as data for plots.

At each operator the path continues with the operand whose value became the operator's value. Ties go to the
earliest sample and the left operand; ``or`` and ``->`` are treated as negated conjunctions, so their ties go
to the left operand too. For until, too, the path goes to the left operand if both are equal.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.core.words import in_unit, readable, resolving
from falsifier.stl import formula as stl
from falsifier.stl.expression import Expression, Number
from falsifier.stl.margins import is_on_limit, shown
from falsifier.stl.program import CompiledPart, Floats

# Margin of a Boolean signal that is true.
_OF_TRUTH = 0.5


class Waypoint(NamedTuple):
    """One sub-formula on the path."""

    part: CompiledPart  # the compiled sub-formula
    sample: int  # sample at which it was evaluated
    value: float  # its robustness at that sample
    window: tuple[int, int] | None  # first and last sample of its operator's window; None if it has no window


def path_to_decider(part: CompiledPart, buffer: Floats) -> list[Waypoint]:
    """Return the path from a compiled formula at time 0 to the predicate that decided its value."""
    path, sample = list[Waypoint](), 0
    while True:
        path.append(Waypoint(part, sample, part.at(buffer, sample), part.window_at(sample)))
        if not part.children:
            return path
        part, sample = _decider(path[-1], buffer)


def _decider(here: Waypoint, buffer: Floats) -> tuple[CompiledPart, int]:
    kind, children, sample = type(here.part.formula), here.part.children, here.sample
    first, last = here.window or (sample, sample)
    if kind is stl.Not:
        return children[0], sample
    if kind is stl.Next:
        return children[0], sample + 1
    if kind is stl.Always:
        return children[0], first + int(children[0].over(buffer, first, last).argmin())
    if kind is stl.Eventually:
        return children[0], first + int(children[0].over(buffer, first, last).argmax())
    if kind is stl.Until:
        left, right = children
        lefts, rights = left.over(buffer, sample, last), right.over(buffer, first, last)
        lowest = np.minimum.accumulate(lefts)[first - sample :]
        best = int(np.minimum(lowest, rights).argmax())
        if lowest[best] <= rights[best]:
            return left, sample + int(lefts[: first - sample + best + 1].argmin())
        return right, first + best
    one, other = (child.at(buffer, sample) for child in children)
    if kind is stl.And:
        is_right = one > other
    elif kind is stl.Or:
        is_right = one < other
    elif kind is stl.Implies or max(-one, other) <= max(-other, one):
        is_right = -one < other
    else:  # of an equivalence the implication backwards
        is_right = -other >= one
    return children[is_right], sample


@dataclass(frozen=True, slots=True)
class Step:
    """One formula on the path to the deciding predicate."""

    formula: stl.Formula
    time: float  # at which it was evaluated, in s
    value: float  # its robustness at that time
    window: tuple[float, float] | None  # start and end in s of its operator's window; None without
    text: str  # what happened here, in words; empty within a chain of ``and`` or ``or``


@dataclass(frozen=True, slots=True)
class VacuousImplication:
    """An implication whose condition was false at every time at which it was evaluated."""

    implication: stl.Implies
    window: tuple[float, float]  # first and last time in s at which it was evaluated
    nearest: float  # time in s at which the condition came closest to being true
    margin: float  # robustness of the condition at that time
    only: bool  # whether it held only for that reason, because its consequence failed at some time

    @property
    def text(self) -> str:
        """The finding in words."""
        over = f"at {seconds(self.window[0])}" if self.window[0] == self.window[1] else _over(self.window)
        off = "exactly on its limit" if is_on_limit(self.margin) else f"false by {readable(-self.margin)}"
        never, near = "not", f"it was {off}"
        if self.window[0] < self.window[1]:
            never = "never"
            near = f"it came closest at {seconds(self.nearest)}, {off}"
        if self.only:
            why = f"its condition was {never} true"
            return f"Vacuous: {self.implication} held {over} only because {why}; {near}."
        return f"The condition of {self.implication} was {never} true {over}; {near}."


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The path from a formula to the predicate that decided its robustness.

    Attributes:
        robustness: robustness of the formula at time 0.
        critical_time: time in s that decided it.
        path: from the formula down to the deciding predicate.
        vacuities: implications whose condition was never true.
    """

    robustness: float
    critical_time: float
    path: tuple[Step, ...]
    vacuities: tuple[VacuousImplication, ...] = ()

    @property
    def text(self) -> str:
        """The path in words, followed by the vacuous implications."""
        *above, predicate = (step.text for step in self.path if step.text)
        decided = f"{'; '.join(above)}: {predicate}" if above else predicate
        return " ".join((f"{decided}.", *(v.text for v in self.vacuities)))


def diagnose(root: CompiledPart, buffer: Floats, trajectory: Trajectory) -> Diagnosis:
    """Return the diagnosis of an evaluated formula."""
    times = trajectory.times
    path = path_to_decider(root, buffer)
    steps = []
    chain: list[stl.Formula] = []
    for here, following in zip(path, [*path[1:], path[-1]], strict=True):
        formula, time, decider = here.part.formula, float(times[here.sample]), following.part.formula
        window = here.window and (float(times[here.window[0]]), float(times[here.window[1]]))
        chain = chain or links(formula)
        text = ""
        if isinstance(formula, stl.Predicate):
            text = _comparison(formula, here.value, trajectory.at(time))
        elif not isinstance(formula, stl.And | stl.Or) or len(chain) <= 2:
            text = _words(formula, decider, window, float(times[following.sample]), here.value)
        elif type(decider) is not type(formula):  # the end of a chain
            name, number = "and" if isinstance(formula, stl.And) else "or", chain.index(decider) + 1
            text = f"part {number} of {len(chain)} joined by '{name}' decided"
        if type(decider) is not type(formula) or len(chain) <= 2:
            chain = []
        steps.append(Step(formula, time, here.value, window, text))
    found = (_vacuity(part, buffer, times) for part in root.walk())
    vacuities = tuple(dict.fromkeys(v for v in found if v is not None))
    return Diagnosis(path[0].value, float(times[path[-1].sample]), tuple(steps), vacuities)


def _vacuity(part: CompiledPart, buffer: Floats, times: Floats) -> VacuousImplication | None:
    if not isinstance(part.formula, stl.Implies):
        return None
    first, last = part.location.first, part.location.last
    lefts, rights = (child.over(buffer, first, last) for child in part.children)
    nearest = int(lefts.argmax())
    if lefts[nearest] >= 0:
        return None
    window = (float(times[first]), float(times[last]))
    return VacuousImplication(
        part.formula, window, float(times[first + nearest]), float(lefts[nearest]), bool((rights < 0).any())
    )


def links(formula: stl.Formula) -> list[stl.Formula]:
    """Parts of a chain of the same connective, from left to right."""
    parts = (links(child) if type(child) is type(formula) else [child] for child in formula.children)
    return [part for found in parts for part in found]


def _words(
    formula: stl.Formula, decider: stl.Formula, window: tuple[float, float] | None, time: float, value: float
) -> str:
    """Say what happened at an operator."""
    side = "left" if formula.children and decider is formula.children[0] else "right"
    match formula:
        case stl.Always():
            return f"G {_over(window)} was lowest at {seconds(time)}"
        case stl.Eventually():
            return f"F {_over(window)} was highest at {seconds(time)}"
        case stl.Until():
            return f"U {_over(window)} was decided by its {side} side at {seconds(time)}"
        case stl.Implies() if side == "left":
            return "the condition of -> decided"
        case stl.Implies():
            return f"the consequence of -> {'decided' if value >= 0 else 'failed'}"
        case stl.Next():
            return f"the next recorded time is {seconds(time)}"
        case stl.Not():
            return f"'not' {'holds' if value >= 0 else 'fails'}"
    name = "and" if isinstance(formula, stl.And) else "or" if isinstance(formula, stl.Or) else "<->"
    return f"the {side} side of '{name}' decided"


def _comparison(predicate: stl.Predicate, value: float, values: dict[str, float]) -> str:
    """State how both sides compare, whether that satisfies the predicate or not: the path may negate it."""
    if isinstance(predicate, stl.Flag) and abs(value) == _OF_TRUTH:
        return f"{predicate} is {'true' if value > 0 else 'false'}"
    left, right = (valued(side, values, value) for side in predicate.sides)
    if is_on_limit(value):
        return f"{left} equals {right}"
    if predicate.operator in ("==", "!="):
        relation = "differs from"
    else:
        is_left_larger = (value > 0) == (predicate.operator in (">", ">="))
        relation = "exceeds" if is_left_larger else "is below"
    return f"{left} {relation} {right} by {readable(abs(value))}"


def valued(side: Expression, values: Mapping[str, float], margin: float, unit: str = "") -> str:
    """State the value of one side of a comparison, with enough digits to tell it from the other side."""
    if isinstance(side, Number):
        return str(side)
    value = float(side.evaluate(values))
    # So many digits that both sides read as different.
    return in_unit(f"{side} = {readable(value, resolving(value, shown(margin)))}", unit)


def _over(window: tuple[float, float] | None) -> str:
    start, end = window or (0.0, 0.0)
    return f"over [{readable(start)}, {readable(end)}] s"


def seconds(time: float) -> str:
    """A time with its unit."""
    return f"{readable(time)} s"
