"""What a search that found nothing cannot say: how probable a violation is, at most."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf

import numpy as np
from numpy.typing import NDArray

from falsifier.core.arguments import whole
from falsifier.core.candidate import Candidate
from falsifier.core.words import counted, margin_words
from falsifier.engines.box import UnitBox
from falsifier.engines.uniform import Uniform
from falsifier.errors import SimulationError, SpecError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem, check_limits
from falsifier.search.assurance.bounds import interval, upper_bound
from falsifier.search.assurance.distribution import distribution_text
from falsifier.search.assurance.splitting import Splitting, least_budget, split
from falsifier.search.assurance.tail import Tail, tail
from falsifier.search.findings import Finding
from falsifier.search.vacuity import Vacuity

Progress = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class Assurance:
    """What random simulations say about the probability of a violation.

    Attributes:
        problem: what was simulated.
        distribution: what was drawn, in words; every probability here refers to it.
        confidence: confidence of the bound and the intervals.
        drawn: number of simulations drawn independently.
        violations: how many of them violate the requirement, as simulated, without confirmation.
        failures: how many of them failed; the bounds count them as violations where that is worse.
        bound: upper confidence bound on the probability of a violation, exact.
        interval: exact two-sided confidence interval of that probability; None without violations.
        smallest: the drawn evaluation with the smallest robustness, without its trajectory.
        tail: estimate of the probability by extreme value theory; None if the draws do not allow one.
        splitting: estimate of the probability by splitting; None if it was not asked for.
        optimum: smallest robustness that a search found; None if none was given.
        findings: what no simulation tested, as of a search; empty with violations.
        interrupted: whether the user stopped it; everything refers to what was drawn by then.
    """

    problem: Problem
    distribution: str
    confidence: float
    drawn: int
    violations: int
    failures: int
    bound: float
    interval: tuple[float, float] | None
    smallest: Evaluation
    tail: Tail | None
    splitting: Splitting | None
    optimum: float | None = None
    findings: tuple[Finding, ...] = ()
    interrupted: bool = False

    @property
    def text(self) -> str:
        """The result in sentences."""
        share = f"{self.confidence * 100:g} %"
        lines = [
            f"{self.violations} of {counted(self.drawn, 'random simulation')} violate the requirement.",
            f"With {share} confidence, the probability of a violation is at most {self.bound:.3g}.",
        ]
        if self.interval is not None:
            low, high = self.interval
            lines.append(f"With {share} confidence, it is between {low:.3g} and {high:.3g}.")
        if self.failures:
            lines.append(
                f"{counted(self.failures, 'simulation')} failed; the bound counts them as violations."
            )
        if any(finding.untested for finding in self.findings):
            lines.append("That is true, but says little: a part of the requirement was not tested.")
        lines += [f"Note: {finding.text}" for finding in self.findings]
        smallest = _robustness(self.smallest)
        lines.append(f"The smallest robustness of these was {smallest:+.6g} ({margin_words(smallest)}).")
        if self.optimum is not None:
            lines.append(_optimum_text(self.optimum, _robustness(self.smallest)))
        if self.tail is not None:
            lines.append(_tail_text(self.tail, share))
        if self.splitting is not None:
            lines.append(_splitting_text(self.splitting, share))
        lines.append(f"Probability means a share of what was drawn: {self.distribution}.")
        if self.interrupted:
            lines.append("Stopped by the user: more simulations would give a lower bound.")
        return "\n".join(lines)


def assess(
    problem: Problem,
    *,
    budget: int,
    seed: int = 0,
    confidence: float = 0.95,
    splitting: int | None = None,
    optimum: float | None = None,
    progress: Progress | None = None,
) -> Assurance:
    """Bound the probability of a violation by random simulations.

    The bound is exact whatever the system is, as long as inputs are drawn as stated. The estimate by
    splitting is not: it is for probabilities too small to be seen in the draws.

    Args:
        problem: what to simulate; inputs are drawn as the engine ``uniform`` does.
        budget: maximum number of simulations.
        seed: seed of the random numbers.
        confidence: confidence of the bound and the intervals, between 0 and 1.
        splitting: how many simulations of the budget are for splitting; default: half, if that is enough for
            an estimate, otherwise none.
        optimum: smallest robustness that a search of the same space found, to be stated beside the bound.
        progress: called with the number of simulations so far.

    Returns:
        What the draws say. Ctrl-C ends them early, and what was drawn by then counts; before the first
        simulation with a verdict, KeyboardInterrupt is raised.

    Raises:
        SpecError: if a number is out of range, there is nothing to vary, or a range exceeds the model's
            limits.
        SimulationError: if every simulation failed.
        ModelError: if the model cannot be used at all.
    """
    budget, seed = whole("budget", budget, least=1), whole("seed", seed, least=0)
    if not 0.0 < confidence < 1.0:
        raise SpecError(f"confidence: expected a number between 0 and 1, got {confidence!r}")
    if not problem.space.names:
        raise SpecError("nothing to vary; give at least one input or parameter a range")
    check_limits(problem)
    rest = _for_splitting(budget, splitting)
    count = _Counted(problem, progress or (lambda _: None))
    engine = Uniform(problem, seed=seed)
    drawn, interrupted = _drawn(count, engine, budget - rest)
    judged = [e for e in drawn if e.robustness is not None]
    if not judged:
        if interrupted:
            raise KeyboardInterrupt
        raise SimulationError(f"{problem.name}: every simulation failed; the last error: {drawn[-1].reason}")
    violations, failures = sum(e.violated for e in drawn), len(drawn) - len(judged)
    low, _ = interval(violations, len(drawn), confidence)
    _, high = interval(violations + failures, len(drawn), confidence)
    divided: Splitting | None = None
    if rest and not interrupted:
        try:
            divided = _split(problem, count, rest, seed=seed, confidence=confidence)
        except KeyboardInterrupt:
            interrupted = True
    return Assurance(
        problem=problem,
        distribution=distribution_text(problem.space),
        confidence=confidence,
        drawn=len(drawn),
        violations=violations,
        failures=failures,
        bound=upper_bound(violations + failures, len(drawn), confidence),
        interval=(low, high) if violations else None,
        smallest=min(judged, key=_robustness),
        tail=tail([_robustness(e) for e in judged], confidence=confidence, seed=seed),
        splitting=divided,
        optimum=optimum,
        findings=() if violations else count.vacuity.findings(),
        interrupted=interrupted,
    )


def _drawn(count: "_Counted", engine: Uniform, wanted: int) -> tuple[list[Evaluation], bool]:
    """Simulate random candidates; return their evaluations, and whether the user stopped that."""
    drawn: list[Evaluation] = []
    try:
        while len(drawn) < wanted:
            drawn.append(count(engine.ask()[0]))
    except KeyboardInterrupt:
        return drawn, True
    return drawn, False


@dataclass(slots=True)
class _Counted:
    """Evaluates candidates without keeping trajectories, counts them, and notes what they do not test."""

    problem: Problem
    progress: Progress
    count: int = 0
    vacuity: Vacuity = field(init=False)

    def __post_init__(self) -> None:
        self.vacuity = Vacuity(self.problem)

    def __call__(self, candidate: Candidate) -> Evaluation:
        evaluation = evaluate(self.problem, candidate)
        self.vacuity.see(evaluation, self.count)
        self.count += 1
        self.progress(self.count)
        return replace(evaluation, trajectory=None)


def _for_splitting(budget: int, wanted: int | None) -> int:
    if wanted is None:
        return budget // 2 if budget // 2 >= least_budget() else 0
    wanted = whole("splitting", wanted, least=0)
    if wanted >= budget:
        raise SpecError(
            f"splitting: expected fewer simulations than the budget of {budget}, got {wanted}: the bound "
            "needs some, too"
        )
    if 0 < wanted < least_budget():
        raise SpecError(f"splitting: expected 0, or at least {least_budget()} simulations, got {wanted}")
    return wanted


def _split(problem: Problem, count: _Counted, budget: int, *, seed: int, confidence: float) -> Splitting:
    box = UnitBox(problem.space)

    def cost(point: NDArray[np.float64]) -> float:
        return _robustness(count(box.candidate(point, origin="splitting", rationale="moved at random")))

    return split(cost, box.dimension, budget=budget, seed=seed, confidence=confidence)


def _robustness(evaluation: Evaluation) -> float:
    return inf if evaluation.robustness is None else evaluation.robustness


def _optimum_text(optimum: float, smallest: float) -> str:
    if optimum < 0:
        return f"A search found a violation, with robustness {optimum:+.6g}."
    nearer = "which came nearer" if optimum < smallest else "which came no nearer"
    return f"A search, {nearer}, found {optimum:+.6g}."


def _tail_text(found: Tail, share: str) -> str:
    if found.is_poor:
        return (
            f"Extreme value theory gives no estimate: its distribution does not fit the {found.points} "
            f"smallest values (p = {found.fit:.2g})."
        )
    effort = f"extreme value theory, the {found.points} smallest values; fit p = {found.fit:.2g}"
    return (
        f"Estimate, not a bound ({effort}): probability {found.probability:.2g}, {share} confidence interval "
        f"{found.low:.2g} to {found.high:.2g}."
    )


def _splitting_text(found: Splitting, share: str) -> str:
    effort = f"multilevel splitting, {counted(found.simulations, 'simulation')}"
    if found.probability is None:
        return (
            f"Estimate, not a bound ({effort}): it reached a robustness of {found.reached:+.6g} and no "
            f"violation; smaller values have a probability below {found.high:.2g}."
        )
    return (
        f"Estimate, not a bound ({effort}): probability {found.probability:.2g}, {share} confidence interval "
        f"{found.low:.2g} to {found.high:.2g}."
    )
