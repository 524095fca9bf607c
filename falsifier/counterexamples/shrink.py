"""Shrinking: the simplest candidate near a counterexample that still violates.

A pass is a pure function that proposes simpler candidates in a fixed order; each is simulated, and the first
that violates replaces the current one. If no pass finds a simpler one, the candidate is a local minimum of
the order in :mod:`falsifier.counterexamples.simplicity`. Nothing is random: the same counterexample always
shrinks to the same result.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import inf

from falsifier.core.arguments import finite, whole
from falsifier.core.candidate import Candidate
from falsifier.core.ranges import InputRange
from falsifier.core.signals import Interpolation, Signal
from falsifier.core.words import readable, resolving
from falsifier.counterexamples.simplicity import rest_value, rounder, simplicity
from falsifier.errors import CandidateError, SpecError, setting
from falsifier.evaluation.confirm import half_step
from falsifier.evaluation.evaluate import Evaluation, check_evaluation, evaluate
from falsifier.problem.problem import Problem
from falsifier.stl.margins import shown

Pass = Callable[[Problem, Candidate], Iterator[Candidate]]
SignalPass = Callable[[Problem, InputRange, Signal], Iterator[Signal]]
Progress = Callable[[Evaluation, int], None]

# Shrinking usually reaches a local minimum with fewer simulations.
BUDGET = 500
# Share of a violation's margin that a simpler one keeps, unless something else is demanded.
KEPT_SHARE = 0.5
# Share of a near miss's robustness by which a simpler one may be farther from a violation.
GIVEN_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class Shrunk:
    """Result of shrinking.

    Attributes:
        original: the counterexample, or the near miss, before shrinking.
        evaluation: the simplest one found; the original if nothing simpler will do.
        simulations: number of simulations used.
        minimal: whether no pass can make it simpler; False if the budget ended first.
        at_most: the largest robustness that was allowed to a simpler one.
    """

    original: Evaluation
    evaluation: Evaluation
    simulations: int
    minimal: bool
    at_most: float


def shrink(
    problem: Problem,
    evaluation: Evaluation,
    *,
    budget: int = BUDGET,
    at_most: float | None = None,
    progress: Progress = lambda evaluation, simulations: None,
) -> Shrunk:
    """Make a counterexample as simple as possible such that it still violates.

    If it violates at half the communication step too, so does the result. A near miss, which does not
    violate, becomes as simple as possible such that it still comes about as near; a simpler one that violates
    is preferred from then on: confirm it.

    Args:
        problem: the problem with the requirement.
        evaluation: the counterexample, or the simulation that came nearest to a violation.
        budget: maximum number of simulations.
        at_most: robustness that the result may have at most; 0 for a counterexample: any violation will do.
            Default: half of a counterexample's, a tenth more than a near miss's.
        progress: called with each simpler one and the number of simulations so far.

    Raises:
        SpecError: if the simulation fails or has a larger robustness, or a number is out of range.
    """
    check_evaluation(problem, evaluation)
    if at_most is not None:
        finite(setting("at_most"), at_most)
    hunt = _Hunt(problem, whole("budget", budget, least=1))
    start = hunt.kept(problem.space.admit(evaluation.candidate))
    if start is None or start.robustness is None:
        raise SpecError(f"nothing to shrink: the simulation of {problem.name} fails")
    hunt.demands_violation = start.violated
    if start.violated and at_most is not None and at_most > 0:
        raise SpecError(
            f"{setting('at_most')}: {problem.name} is violated: expected 0 or less, got {at_most!r}"
        )
    share = KEPT_SHARE if start.violated else 1 + GIVEN_SHARE
    hunt.at_most = share * start.robustness if at_most is None else at_most
    if hunt.kept(start.candidate) is None:
        digits = resolving(start.robustness, start.robustness - hunt.at_most)
        found, most = (readable(shown(r), digits, "+") for r in (start.robustness, hunt.at_most))
        raise SpecError(f"nothing to shrink: the robustness of {problem.name} is {found}, more than {most}")
    if start.violated:
        with suppress(_BudgetUsedUpError):
            hunt.demands_half_step = hunt.violates_at_half_step(start.candidate)
    best, minimal = start, False
    try:
        while not minimal:
            minimal = True
            for propose in PASSES:
                while (simpler := hunt.first(propose, best)) is not None:
                    best, minimal = simpler, False
                    progress(best, hunt.simulations)
                    if best.violated and not hunt.demands_violation:
                        hunt.demands_violation, hunt.at_most = True, 0.0
    except _BudgetUsedUpError:
        minimal = False
    unchanged = best.candidate.key == start.candidate.key
    return Shrunk(evaluation, evaluation if unchanged else best, hunt.simulations, minimal, hunt.at_most)


class _BudgetUsedUpError(Exception):
    """The next simulation would exceed the budget."""


@dataclass(slots=True)
class _Hunt:
    """Counts the simulations of one shrinking and never repeats one."""

    problem: Problem
    budget: int
    at_most: float = inf
    demands_violation: bool = False
    demands_half_step: bool = False
    simulations: int = 0
    _known: dict[object, Evaluation] = field(default_factory=dict)  # by experiment and candidate

    def first(self, propose: Pass, best: Evaluation) -> Evaluation | None:
        """Find the first that keeps what is demanded among the simpler candidates that a pass proposes."""
        limit = simplicity(self.problem, best.candidate)
        for proposal in propose(self.problem, best.candidate):
            try:
                candidate = self.problem.space.admit(proposal)
            except CandidateError:  # passes may propose values outside the problem's ranges
                continue
            if simplicity(self.problem, candidate) < limit and (found := self.kept(candidate)):
                return replace(found, candidate=replace(candidate, origin="shrink", rationale=""))
        return None

    def kept(self, candidate: Candidate) -> Evaluation | None:
        """Simulate a candidate; return its evaluation if it has all that is demanded."""
        found = self._simulated(self.problem, candidate)
        if found.robustness is None or found.robustness > self.at_most:
            return None
        if self.demands_violation and not found.violated:
            return None
        return None if self.demands_half_step and not self.violates_at_half_step(candidate) else found

    def violates_at_half_step(self, candidate: Candidate) -> bool:
        return self._simulated(half_step(self.problem), candidate).violated

    def _simulated(self, problem: Problem, candidate: Candidate) -> Evaluation:
        key = problem.experiment.step, candidate.key
        if key not in self._known:
            if self.simulations >= self.budget:
                raise _BudgetUsedUpError
            self.simulations += 1
            self._known[key] = evaluate(problem, candidate)
        return self._known[key]


def at_rest(problem: Problem, candidate: Candidate) -> Iterator[Candidate]:
    """All inputs at rest and parameters nominal together, then each of them alone."""
    constants = {
        r.name: constant_signal(problem, r, rest)
        for r in problem.space.inputs
        if (rest := rest_value(problem, r)) is not None
    }
    nominal = {p.name: rest for p in problem.space.parameters if (rest := rest_value(problem, p)) is not None}
    yield replace(
        candidate, signals={**candidate.signals, **constants}, parameters={**candidate.parameters, **nominal}
    )
    for name, signal in constants.items():
        yield with_signal(candidate, name, signal)
    for name, value in nominal.items():
        yield with_parameter(candidate, name, value)


def constant(problem: Problem, r: InputRange, signal: Signal) -> Iterator[Signal]:
    """Constant, at a bound or at one of its values."""
    for value in dict.fromkeys((r.low, r.high, *sorted(signal.values))):
        yield constant_signal(problem, r, value)


def fewer_control_points(problem: Problem, r: InputRange, signal: Signal) -> Iterator[Signal]:
    """Free signals without some of their control points: large blocks first, then single points."""
    count = len(signal.times)
    size = count // 2 if r.free else 0
    while size:
        for start in range(count - size, 0, -1):
            yield _with_points(signal, [k for k in range(count) if not start <= k < start + size])
        size //= 2


def fewer_changes(problem: Problem, r: InputRange, signal: Signal) -> Iterator[Signal]:
    """Without one of its changes.

    Everything after the change, everything before it, or only the neighbouring stretch is made equal.
    """
    values = signal.values
    for (before, start), (_, end) in pairwise(stretches(values)):
        left, right = values[before], values[start]
        yield with_stretch(signal, start, len(values), left)
        yield with_stretch(signal, 0, start, right)
        yield with_stretch(signal, start, end, left)
        yield with_stretch(signal, before, start, right)


def fewer_values(problem: Problem, r: InputRange, signal: Signal) -> Iterator[Signal]:
    """Each value replaced, at all its occurrences, by rest, a bound or another of the values.

    Where some of its occurrences stay, a signal is no simpler: it has as many values and changes.
    """
    rest, known = rest_value(problem, r), (r.low, r.high, *sorted(set(signal.values)))
    for old in sorted(set(signal.values)):
        for new in dict.fromkeys(known if rest is None else (rest, *known)):
            yield _with_value(signal, old, new)


def simpler_interpolation(problem: Problem, r: InputRange, signal: Signal) -> Iterator[Signal]:
    """Free signals with constant, then with linear interpolation."""
    ways: tuple[Interpolation, ...] = ("constant", "linear") if r.free else ()
    for interpolation in ways:
        simpler = replace(signal, interpolation=interpolation)
        yield simpler
        yield _with_points(simpler, [first for first, _ in stretches(signal.values)])


def rounder_parameters(problem: Problem, candidate: Candidate) -> Iterator[Candidate]:
    """Each parameter at a bound, or with fewer digits."""
    for p in problem.space.parameters:
        for new in (p.low, p.high, *rounder(candidate.parameters[p.name])):
            yield with_parameter(candidate, p.name, new)


def rounder_values(problem: Problem, r: InputRange, signal: Signal) -> Iterator[Signal]:
    """Each value with fewer digits."""
    for old in sorted(set(signal.values)):
        for new in rounder(old):
            yield _with_value(signal, old, new)


def rounder_times(problem: Problem, r: InputRange, signal: Signal) -> Iterator[Signal]:
    """Each time of a free signal with fewer digits."""
    around = (-1.0, *signal.times, problem.space.stop_time)
    for k, time in enumerate(signal.times if r.free else ()):
        for new in rounder(time):
            if around[k] < new < around[k + 2]:
                yield replace(signal, times=(*signal.times[:k], new, *signal.times[k + 1 :]))


def _of_each(propose: SignalPass) -> Pass:
    """Return the pass that proposes other signals for one input after the other."""

    def proposals(problem: Problem, candidate: Candidate) -> Iterator[Candidate]:
        for r in problem.space.inputs:
            for signal in propose(problem, r, candidate.signals[r.name]):
                yield with_signal(candidate, r.name, signal)

    return proposals


PASSES: tuple[Pass, ...] = (
    at_rest,
    _of_each(constant),
    _of_each(fewer_control_points),
    _of_each(fewer_changes),
    _of_each(fewer_values),
    _of_each(simpler_interpolation),
    rounder_parameters,
    _of_each(rounder_values),
    _of_each(rounder_times),
)


def constant_signal(problem: Problem, r: InputRange, value: float) -> Signal:
    """Return the simplest constant signal that the input's parameterization allows."""
    times = (0.0,) if r.free else problem.space.fixed_times(r)
    return Signal(times, (value,) * len(times), "constant" if r.free else r.interpolation, r.hold)


def stretches(values: tuple[float, ...]) -> list[tuple[int, int]]:
    """Return the first index and the end index (exclusive) of each stretch of equal values."""
    starts = [0, *(k + 1 for k, (a, b) in enumerate(pairwise(values)) if a != b), len(values)]
    return list(pairwise(starts))


def sampled_stretches(signal: Signal, stop_time: float) -> list[tuple[int, int]]:
    """Return those that are sampled: one that is held may be over, or the simulation, before it is."""
    at = (*signal.moments, inf)
    return [(i, k) for i, k in stretches(signal.values) if at[i] < at[k] and at[i] <= stop_time]


def with_signal(candidate: Candidate, name: str, signal: Signal) -> Candidate:
    """Return the candidate with one input's signal replaced."""
    return replace(candidate, signals={**candidate.signals, name: signal})


def with_parameter(candidate: Candidate, name: str, value: float) -> Candidate:
    """Return the candidate with one parameter replaced."""
    return replace(candidate, parameters={**candidate.parameters, name: value})


def with_stretch(signal: Signal, first: int, end: int, value: float) -> Signal:
    """Return the signal with this value at the control points from the first to before the end."""
    return replace(signal, values=(*signal.values[:first], *(value,) * (end - first), *signal.values[end:]))


def _with_value(signal: Signal, old: float, new: float) -> Signal:
    return replace(signal, values=tuple(new if v == old else v for v in signal.values))


def _with_points(signal: Signal, kept: list[int]) -> Signal:
    times, values = (tuple(part[k] for k in kept) for part in (signal.times, signal.values))
    return replace(signal, times=times, values=values)
