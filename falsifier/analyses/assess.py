"""What a search that found nothing cannot say: how probable a violation is, at most.

The bounds are those of Clopper and Pearson, The use of confidence or fiducial limits illustrated in the case
of the binomial, Biometrika 26 (1934) 404-413. They hold for every system and every number of draws. Nothing
is extrapolated from the draws: a narrow region of violations leaves no trace in the robustness beside it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from math import inf

import numpy as np

from falsifier.core.arguments import finite, whole
from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.core.space import SearchSpace
from falsifier.core.words import counted, ends, in_unit, readable
from falsifier.engines.box import Proposal
from falsifier.engines.simple import Uniform
from falsifier.errors import SimulationError, SpecError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem, check_limits, check_problem
from falsifier.search.findings import Failure, Finding, failures as by_cause
from falsifier.search.vacuity import Vacuity
from falsifier.stl.margins import margin_words, signed

Progress = Callable[[int], None]


class Draws(Uniform):
    """The engine ``uniform``, but with each allowed number of an integer or enumeration equally likely.

    No engine draws these numbers with the same seed: a search that found nothing would have chosen them.
    """

    def _propose(self, rng: np.random.Generator) -> Proposal:
        point = super()._propose(rng.spawn(1)[0]).point
        for r, group in zip(self.box.space.ranges, self.box.groups, strict=True):
            if r.kind != "real" and r.low < r.high:
                drawn = np.array([r.numbers[int(share * len(r.numbers))] for share in point[group]])
                point[group] = r.share_of(drawn)
        return Proposal(point, "uniform random")


@dataclass(frozen=True, slots=True)
class Searched:
    """What a search of the same space found, to be stated beside the bound.

    Attributes:
        simulations: number of simulations of the search.
        smallest_robustness: smallest robustness that it found; None if every simulation failed.
        violation: in how many simulations it found a violation that no confirmation doubts; None without one.
        drawable: whether the inputs of that violation are among those that are drawn.
        unconfirmed: how many violations were not confirmed.
    """

    simulations: int
    smallest_robustness: float | None
    violation: int | None = None
    drawable: bool = True
    unconfirmed: int = 0


@dataclass(frozen=True, slots=True)
class Assurance:
    """What random simulations say about the probability of a violation.

    Attributes:
        problem: what was simulated.
        distribution: what was drawn, in words; every probability here refers to it.
        confidence: confidence of the bound, and of the interval.
        drawn: number of simulations drawn independently.
        violations: how many of them violate the requirement, as simulated, without confirmation.
        failures: why simulations among them failed; the bounds count them as violations where that is worse.
        bound: one-sided upper confidence bound on the probability of a violation, exact.
        interval: exact two-sided confidence interval of that probability; from 0 without violations.
        best: the drawn evaluation with the smallest robustness, without its trajectory.
        searched: what a search found; None if none was given.
        findings: what no simulation tested; empty with violations.
        interrupted: whether the user stopped it; everything refers to what was drawn by then.
    """

    problem: Problem
    distribution: str
    confidence: float
    drawn: int
    violations: int
    failures: tuple[Failure, ...]
    bound: float
    interval: tuple[float, float]
    best: Evaluation
    searched: Searched | None = None
    findings: tuple[Finding, ...] = ()
    interrupted: bool = False

    @property
    def text(self) -> str:
        """The result in sentences."""
        share = f"{self.confidence * 100:g} %"
        lines = [
            f"Violations: {self.violations} of {counted(self.drawn, 'random simulation')}.",
            f"With {share} confidence (one-sided), the probability of a violation is at most "
            f"{_rounded(self.bound, ROUND_CEILING)}.",
        ]
        if self.violations:
            low, high = map(_rounded, self.interval, (ROUND_FLOOR, ROUND_CEILING))
            lines.append(f"With {share} confidence (two-sided), it is between {low} and {high}.")
        if self.failures:
            lines += [f"{failure.text}." for failure in self.failures]
            lines.append("The bound counts failed simulations as violations.")
        if any(finding.untested for finding in self.findings):
            lines.append("That is true, but says little: a part of the requirement was not tested.")
        lines += [f"Note: {finding.text}" for finding in self.findings]
        smallest = _robustness(self.best)
        lines.append(f"The smallest robustness of these was {signed(smallest)} ({margin_words(smallest)}).")
        if self.searched is not None:
            lines.append(self._searched_text(self.searched))
        lines.append(
            "This probability is for inputs drawn uniformly from the search space with this "
            f"parameterization, not for inputs in operation: {self.distribution}."
        )
        if self.interrupted:
            lines.append("Stopped by the user: more simulations would say more.")
        return "\n".join(lines)

    def _searched_text(self, searched: Searched) -> str:
        if searched.violation is None:
            effort = f"A search of {counted(searched.simulations, 'simulation')}"
            if (least := searched.smallest_robustness) is None:
                return f"{effort} has no verdict: all of them failed."
            nearer = "came nearer" if least < _robustness(self.best) else "came no nearer"
            doubtful = searched.unconfirmed
            doubt = f" ({counted(doubtful, 'violation')}, not confirmed)" if doubtful else ""
            return f"{effort} {nearer}: its smallest robustness was {signed(least)}{doubt}."
        found = f"The search found a violation in {counted(searched.violation, 'simulation')}"
        if not searched.drawable:
            return f"{found}, with control points that are not drawn here: the bound says nothing about it."
        return f"{found}." if self.violations else f"{found}, although no draw violates."


def assess(
    problem: Problem,
    *,
    budget: int,
    seed: int = 0,
    confidence: float = 0.95,
    searched: Sequence[Evaluation] = (),
    doubtful: Sequence[Confirmation] = (),
    progress: Progress | None = None,
) -> Assurance:
    """Bound the probability of a violation by random simulations.

    The bound is exact whatever the system is, as long as inputs are drawn as stated.

    Args:
        problem: what to simulate; every number is drawn on its own, each that is allowed equally likely.
        budget: maximum number of simulations.
        seed: seed of the random numbers.
        confidence: confidence of the bound, and of the interval, between 0 and 1.
        searched: evaluations of a search of the same space, in order, to be stated beside the bound, such as
            those of a Result.
        doubtful: violations of that search that were not confirmed: ``refuted`` and ``fragile`` of a Result.
        progress: called with the number of simulations so far.

    Returns:
        What the draws say. Ctrl-C ends them early, and what was drawn by then counts; before the first
        simulation with a verdict, KeyboardInterrupt is raised.

    Raises:
        SpecError: if a number or range exceeds what is allowed, or there is nothing to vary.
        SimulationError: if every simulation failed.
        ModelError: if the model cannot be used at all.
    """
    check_problem(problem)
    budget, seed = whole("budget", budget, least=1), whole("seed", seed, least=0)
    if not 0.0 < finite("confidence", confidence) < 1.0:
        raise SpecError(f"confidence: expected a number between 0 and 1, got {confidence!r}")
    if not problem.space.names:
        raise SpecError("nothing to vary; give at least one input or parameter a range")
    check_limits(problem)
    engine, vacuity = Draws(problem, seed=seed), Vacuity(problem)
    drawn: list[Evaluation] = []
    interrupted = False
    try:
        while len(drawn) < budget:
            evaluation = evaluate(problem, engine.ask()[0])
            vacuity.see(evaluation, len(drawn))
            drawn.append(replace(evaluation, trajectory=None))  # trajectories would fill the memory
            if progress is not None:
                progress(len(drawn))
    except KeyboardInterrupt:
        interrupted = True
    judged = [e for e in drawn if e.robustness is not None]
    if not judged:
        if interrupted:
            raise KeyboardInterrupt
        raise SimulationError(f"{problem.name}: every simulation failed; the last error: {drawn[-1].reason}")
    violations, failures = sum(e.violated for e in drawn), len(drawn) - len(judged)
    each = (1.0 + confidence) / 2.0
    is_all = problem.space.candidates == len({e.candidate.key for e in drawn})
    return Assurance(
        problem=problem,
        distribution=_distribution_text(problem.space),
        confidence=confidence,
        drawn=len(drawn),
        violations=violations,
        failures=by_cause((i, e.reason) for i, e in enumerate(drawn) if e.robustness is None),
        bound=upper_bound(violations + failures, len(drawn), confidence),
        interval=(
            lower_bound(violations, len(drawn), each),
            upper_bound(violations + failures, len(drawn), each),
        ),
        best=min(judged, key=_robustness),
        searched=_told(searched, doubtful, problem.space),
        findings=() if violations else vacuity.findings(is_all=is_all),
        interrupted=interrupted,
    )


def _robustness(evaluation: Evaluation) -> float:
    return inf if evaluation.robustness is None else evaluation.robustness


def _rounded(bound: float, rounding: str) -> str:
    """Return a bound with three digits, rounded away from what it bounds; errors of floats do not count."""
    return f"{float(Context(prec=3, rounding=rounding).create_decimal(round(bound, 12))):g}"


def upper_bound(happened: int, trials: int, confidence: float) -> float:
    """Return the bound below which the probability lies with at least this confidence.

    >>> round(upper_bound(0, 300, 0.95), 5)
    0.00994
    """
    from scipy.special import betaincinv

    return 1.0 if happened >= trials else float(betaincinv(happened + 1, trials - happened, confidence))


def lower_bound(happened: int, trials: int, confidence: float) -> float:
    """Return the bound above which the probability lies with at least this confidence."""
    return 1.0 - upper_bound(trials - happened, trials, confidence)


def _told(
    evaluations: Sequence[Evaluation], doubtful: Sequence[Confirmation], space: SearchSpace
) -> Searched | None:
    if not evaluations:
        return None
    doubted = [confirmation.candidate for confirmation in doubtful]
    smallest = min((e.robustness for e in evaluations if e.robustness is not None), default=None)
    found = [k for k, e in enumerate(evaluations) if e.violated and e.candidate not in doubted]
    if not found:
        return Searched(len(evaluations), smallest, unconfirmed=len(doubted))
    signals = ((r, evaluations[found[0]].candidate.signals[r.name]) for r in space.inputs)
    drawable = all(space.is_fixed(r, signal) or not signal.switches for r, signal in signals)
    return Searched(len(evaluations), smallest, found[0] + 1, drawable, len(doubted))


def _distribution_text(space: SearchSpace) -> str:
    """Describe what is drawn: each control point and parameter on its own."""
    parts = [
        *(_input_text(r, space) for r in space.inputs),
        *(f"{p.name} {'log-' * (p.scale == 'log')}uniform in {_range_text(p)}" for p in space.parameters),
        "all numbers independent of each other",
    ]
    if any(r.free is not None for r in space.inputs):
        parts.append("signals with other control points, which a search may try, are not drawn")
    return "; ".join(parts)


def _input_text(r: InputRange, space: SearchSpace) -> str:
    if r.control_points == 1:
        return f"{r.name} constant, uniform in {_range_text(r)}"
    spacing = space.fixed_times(r)[1]
    held = f", held for {readable(r.hold)} s" if r.hold is not None else ""
    return (
        f"{r.name} with {r.control_points} control points {spacing:.4g} s apart, {r.interpolation}{held}, "
        f"each uniform in {_range_text(r)}"
    )


def _range_text(r: InputRange | ParameterRange) -> str:
    limits = in_unit(f"[{', '.join(ends(r.low, r.high))}]", r.unit)
    return limits if r.kind == "real" else f"{limits}, each allowed number equally likely"
