"""Why a counterexample violates, or a near miss does not: what broke, and what came of resetting each input.

Each signal, each of its stretches and each parameter is reset to rest, one at a time, and the model is
simulated again. That shows what one change did. It does not show that an input is needed, nor that it has no
effect: several at once may do what none does alone.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import InputRange, ParameterRange, nearest_value
from falsifier.core.signals import Signal
from falsifier.core.words import in_unit, named, readable
from falsifier.counterexamples.shrink import (
    constant_signal,
    sampled_stretches,
    with_parameter,
    with_signal,
    with_stretch,
)
from falsifier.counterexamples.simplicity import rest_value
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import Evaluation, check_evaluation, evaluate, monitor_for
from falsifier.problem.problem import Problem
from falsifier.stl import Diagnosis, in_words
from falsifier.stl.margins import is_on_limit, margin_words, signed

# Maximum number of stretches of one signal that are reset one at a time; the longest are chosen.
_MAX_STRETCHES = 12


@dataclass(frozen=True, slots=True)
class Effect:
    """What came of resetting one part of a counterexample alone.

    Attributes:
        name: name of the input or parameter.
        span: start and end in s of that value, equal for a point of a curve; None for all of a signal, or a
            parameter.
        instead: the value it was reset to.
        is_rest: whether that is the rest value; otherwise it is the middle of the range.
        robustness: robustness after the reset; None if the simulation failed.
        violated: whether the requirement was violated after the reset.
    """

    name: str
    span: tuple[float, float] | None
    instead: float
    is_rest: bool
    robustness: float | None = None
    violated: bool = False


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why a counterexample violates, or how near a simulation comes to it.

    Attributes:
        problem: the problem with the requirement.
        evaluation: the counterexample, or the nearest miss.
        diagnosis: the path from the formula to the deciding predicate.
        effects: effects of resetting parts: each whole signal and its stretches, then parameters.
    """

    problem: Problem
    evaluation: Evaluation
    diagnosis: Diagnosis
    effects: tuple[Effect, ...]

    @property
    def text(self) -> str:
        """The explanation in one paragraph."""
        requirement = self.problem.requirement
        demand = (requirement.description or in_words(requirement.formula)).rstrip(".")
        return " ".join((f"{self.problem.name} requires: {demand}.", *self._found(), *self._tried()))

    @property
    def violated(self) -> bool:
        """Whether the requirement is violated; otherwise the simulation is a near miss."""
        return self.evaluation.violated

    def _found(self) -> Iterator[str]:
        verdict, robustness = self.evaluation.verdict, self.diagnosis.robustness
        named = "robustness, the margin by which it holds"
        if verdict is None or verdict.breach is None:
            found = f"It is not violated here: the {named}, is {signed(robustness)}"
            if is_on_limit(robustness):
                found = f"It {margin_words(robustness, str(self.diagnosis.path[-1].formula))}"
            yield f"{found}: {self.diagnosis.text}"
            return
        yield f"What broke: {verdict.breach.text}."
        decided = f"decided by {verdict.predicate} at {readable(verdict.critical_time)} s"
        limit = f": {margin_words(robustness, verdict.predicate)}" if is_on_limit(robustness) else ""
        yield f"The {named}, is {signed(robustness)}, {decided}{limit}."
        yield from (vacuity.text for vacuity in self.diagnosis.vacuities)

    def _tried(self) -> Iterator[str]:
        """What came of resetting each part alone, and no conclusion from it; the largest robustness first."""
        whole = [e for e in self.effects if e.span is None]
        for effect in sorted(whole, key=lambda e: inf if e.robustness is None else -e.robustness):
            yield self._told(effect)
            yield from map(self._told, self._stretches(effect))
        if len(whole) > 1:
            yield "Each was reset alone; several at once were not tried."

    def _stretches(self, whole: Effect) -> list[Effect]:
        """The stretches of a signal that alone do what resetting all of it does, unless all of them do."""
        spans = [e for e in self.effects if e.name == whole.name and e.span is not None]
        if self.violated:
            kept = [e for e in spans if not (whole.violated or e.violated or e.robustness is None)]
            return kept if len(kept) < len(spans) else []
        rising = (whole.robustness or 0.0) > self.diagnosis.robustness
        return sorted(spans, key=lambda e: -(e.robustness or 0.0))[:1] if rising else []

    def _told(self, effect: Effect) -> str:
        ends = dict.fromkeys(readable(t, 4) for t in effect.span or ())
        during = f" {'from' if len(ends) > 1 else 'at'} {' to '.join(ends)} s" if ends else ""
        what = f"With {effect.name} {self._instead(effect)}{during} alone"
        if effect.robustness is None:
            return f"{what}, the simulation fails."
        if self.violated:
            came = "still violated" if effect.violated else "not violated"
        elif effect.violated:
            came = "violated, which is not confirmed yet"
        else:
            change = effect.robustness - self.diagnosis.robustness
            came = "farther from a violation" if change > 0 else "nearer to one"
            came = "the same" if is_on_limit(change) else came
        return f"{what}: {signed(effect.robustness, 4)}, {came}."

    def _instead(self, effect: Effect) -> str:
        unit = next((v.unit for v in self.problem.info.variables if v.name == effect.name), "")
        ranged = next(r for r in self.problem.space.ranges if r.name == effect.name)
        number = in_unit(named(readable(effect.instead, 4), ranged.kind, ranged.items), unit)
        if effect.is_rest:
            return f"{'at rest' if isinstance(ranged, InputRange) else 'at its nominal value'} ({number})"
        is_between = ranged.low < effect.instead < ranged.high
        near = "at" if effect.instead == ranged.at(0.5) else "near"
        middle = f"{near} the middle of its range{ranged.manner}"
        return f"{middle if is_between else 'at an end of its range'} ({number})"


def explain(problem: Problem, evaluation: Evaluation) -> Explanation:
    """Diagnose a counterexample, or a near miss, and reset its parts one at a time.

    Raises:
        SpecError: if no evaluation is given, or it has no trajectory.
    """
    check_evaluation(problem, evaluation)
    if evaluation.trajectory is None:
        raise SpecError("no trajectory to explain: pass an evaluation that has one, such as a result's best")
    diagnosis = monitor_for(problem).diagnose(evaluation.trajectory)
    return Explanation(problem, evaluation, diagnosis, tuple(_effects(problem, evaluation.candidate)))


def _effects(problem: Problem, candidate: Candidate) -> Iterator[Effect]:
    """Reset each signal, each of its longest stretches and each parameter, if that changes anything."""

    def effect(reset: Candidate, to: Effect, span: tuple[float, float] | None = None) -> Iterator[Effect]:
        if reset.key != candidate.key:
            found = evaluate(problem, problem.space.admit(reset))
            yield replace(to, span=span, robustness=found.robustness, violated=found.violated)

    for r in problem.space.inputs:
        signal = candidate.signals[r.name]
        to = _reset(problem, r, signal.values)
        if set(signal.values) != {to.instead}:
            yield from effect(with_signal(candidate, r.name, constant_signal(problem, r, to.instead)), to)
        for first, end in _longest(signal, problem.space.stop_time):
            span = _span(signal, first, end, problem.space.stop_time)
            reset = with_signal(candidate, r.name, with_stretch(signal, first, end, to.instead))
            yield from effect(reset, to, span)
    for p in problem.space.parameters:
        to = _reset(problem, p, (candidate.parameters[p.name],))
        yield from effect(with_parameter(candidate, p.name, to.instead), to)


def _reset(problem: Problem, ranged: InputRange | ParameterRange, values: tuple[float, ...]) -> Effect:
    """Return the effect of a reset that is still to be simulated.

    It is to rest, or to the middle of the range if rest is unknown or all values are at rest already.
    """
    rest = rest_value(problem, ranged)
    if rest is not None and any(v != rest for v in values):
        return Effect(ranged.name, None, rest, is_rest=True)
    middle = ranged.at(0.5)
    # Of two that are equally near, such as those of a Boolean, the other one.
    aside = 0.0 if ranged.kind == "real" else 0.25 if values[0] < middle else -0.25
    return Effect(ranged.name, None, nearest_value(ranged, middle + aside), is_rest=False)


def _longest(signal: Signal, stop_time: float) -> list[tuple[int, int]]:
    """The longest stretches of equal values, in time order; none for a constant signal."""
    found = sampled_stretches(signal, stop_time)
    return sorted(sorted(found, key=lambda s: s[0] - s[1])[:_MAX_STRETCHES]) if len(found) > 1 else []


def _span(signal: Signal, first: int, end: int, stop_time: float) -> tuple[float, float]:
    """Interval in s in which equal control points are the value: up to the last one, or to the next step."""
    times = (*signal.moments, stop_time)
    last = end - (signal.interpolation != "constant" and end < len(signal.times))
    return times[first], min(times[last], stop_time)
