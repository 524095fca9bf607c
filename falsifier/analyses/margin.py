"""Where a requirement starts to be violated: the threshold between what was falsified and what was not."""

import re
from bisect import bisect_left
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import ceil, floor, inf, isfinite, log2, log10
from numbers import Real

from falsifier.analyses.lint import ranges_of
from falsifier.core.arguments import finite, instance, list_of, whole
from falsifier.core.words import counted
from falsifier.engines import DEFAULT_ENGINE, make_engine
from falsifier.errors import SimulationError, SpecError, setting, written
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import Evaluation, judge
from falsifier.problem.problem import Problem, check_problem
from falsifier.problem.requirement import formula_of
from falsifier.problem.shorthand import requirement_of
from falsifier.search import DEFAULT_SIMULATIONS
from falsifier.search.budget import Budget
from falsifier.search.events import Evaluated, Event
from falsifier.search.loop import search
from falsifier.search.make_engines import check_names
from falsifier.stl import Formula
from falsifier.stl.tell_apart import differences

LIMIT = "{limit}"
# The search ends when the threshold is known to this share of the range.
RESOLUTION = 0.01
# Thresholds are this share of that apart, or a power of ten below it, so that they can be told exactly.
_FINEST = 0.01
# Violations of a threshold that are tried to confirm, the clearest first: few may be of no use, not all.
_TRIED = 3

OnSearch = Callable[[float, bool, int], None]


@dataclass(frozen=True, slots=True)
class Margin:
    """Between which thresholds a requirement starts to be violated.

    Attributes:
        falsified_at: threshold nearest to the other one with a confirmed violation; None if there was none.
        unfalsified_at: threshold nearest to it at which a search found nothing; None if all were falsified.
        simulations: number of simulations of all searches together, without confirmations.
        searches: the thresholds that were searched, in order, and whether a violation was confirmed.
        complete: whether the two are close enough; False: the budget was used up before.
        interrupted: whether the user stopped it; the thresholds are what was known by then.
    """

    falsified_at: float | None
    unfalsified_at: float | None
    simulations: int
    searches: tuple[tuple[float, bool], ...]
    complete: bool
    interrupted: bool = False

    @property
    def text(self) -> str:
        """The result in one sentence."""
        effort = f"({counted(self.simulations, 'simulation')}, {counted(len(self.searches), 'search')})"
        ends = [] if self.falsified_at is None else [f"falsified at {self.falsified_at:.12g}"]
        ends += [] if self.unfalsified_at is None else [f"not falsified at {self.unfalsified_at:.12g}"]
        if self.interrupted:
            return f"{', '.join(ends) or 'nothing is known yet'} {effort}; stopped by the user"
        if self.unfalsified_at is None:
            ends = [f"falsified in the whole range, even at {self.falsified_at:.12g}"]
        elif self.falsified_at is None:
            ends = [f"not falsified in the whole range, not even at {self.unfalsified_at:.12g}"]
        more = "" if self.complete else "; a larger budget narrows it"
        return f"{', '.join(ends)} {effort}{more}"


def margin(
    problem: Problem,
    vary: str,
    between: tuple[float, float],
    *,
    engine: str = DEFAULT_ENGINE,
    budget: int = DEFAULT_SIMULATIONS,
    seed: int = 0,
    searched: OnSearch | None = None,
) -> Margin:
    """Find the threshold at which a search starts to find violations, by bisection.

    Robustness must change in one direction with the threshold. All searches share their simulations: each is
    judged for every threshold. Thresholds in windows are those that fit the time grid.

    Args:
        problem: the model and what may be varied; its requirement is replaced.
        vary: formula, or a template and its arguments, with ``{limit}`` in place of the threshold.
        between: smallest and largest threshold.
        engine: name of the engine.
        budget: maximum number of simulations of all searches together, at least 20.
        seed: seed of the engines.
        searched: called after each search with the threshold, whether it was falsified, and the number of
            simulations so far.

    Returns:
        The thresholds. Ctrl-C ends the searches early; then they are what was known by then.

    Raises:
        SpecError: if the formula, the range, the engine or a number is not valid, or if the threshold changes
            nothing, or not always in the same direction.
        SimulationError: if most simulations failed.
    """
    check_problem(problem)
    instance("vary", vary, str, "text")
    given = list_of("between", between, Real, "two numbers")
    if LIMIT not in vary:
        raise SpecError(f"{_stated()}: expected {LIMIT} in place of the threshold, got {vary!r}")
    if len(given) != 2 or not -inf < given[0] < given[1] < inf:
        raise SpecError(
            f"{setting('between')}: expected two numbers (LOW, HIGH) with LOW < HIGH, got {between!r}"
        )
    low, high = (finite("between", number) for number in given)
    if not isfinite(high - low):
        raise SpecError(f"{setting('between')}: {low:g} and {high:g} are too far apart")
    budget, seed = whole("budget", budget, least=20), whole("seed", seed, least=0)
    check_names(engine, None)
    lowest, highest = (formula_at(problem, vary, threshold) for threshold in (low, high))
    experiment = problem.experiment
    step, samples = experiment.output_interval, experiment.samples
    signs = differences(lowest, highest, step=step, samples=samples, ranges=ranges_of(problem))
    if len(signs) != 1:
        what = "is the same" if not signs else "changes in either direction, depending on the signals,"
        raise SpecError(f"{_stated()}: the robustness {what} for {LIMIT} = {low:g} and {high:g}")
    finest = 10.0 ** floor(log10(_FINEST * RESOLUTION * (high - low)))
    between_two = finest if lowest.windows == highest.windows else step
    count = ceil(round((high - low) / between_two, 6))
    thresholds = [*(float(f"{low + k * between_two:.12g}") for k in range(count)), high]
    thresholds = thresholds if signs == {-1} else thresholds[::-1]
    state = _Bisection(problem, vary, engine, budget, seed, searched or (lambda *_: None), thresholds)
    complete = interrupted = False
    try:
        complete = state.narrowed()
    except KeyboardInterrupt:
        interrupted = True
        with suppress(KeyboardInterrupt):  # whoever does not wait for it gets what is known
            state.judge_all()  # what the search that was stopped has simulated counts, too
    failed = [evaluation for evaluation in state.history if evaluation.status != "ok"]
    if not interrupted and 2 * len(failed) > len(state.history):
        some = f"{len(failed)} of {counted(len(state.history), 'simulation')}"
        raise SimulationError(f"{problem.name}: {some} failed; the last error: {failed[-1].reason}")
    falsified = None if state.reached < 0 else thresholds[state.reached]
    unfalsified = thresholds[state.hard] if state.hard < len(thresholds) else None
    return Margin(falsified, unfalsified, len(state.history), tuple(state.searches), complete, interrupted)


def stated_at(vary: str, threshold: float) -> str:
    """Return the text with this threshold, in parentheses where a power would bind more than its sign."""
    said = f"{threshold:.12g}"
    return re.sub(rf"{re.escape(LIMIT)}(?=\s*\^)", f"({said})", vary).replace(LIMIT, said)


def formula_at(problem: Problem, vary: str, threshold: float) -> Formula:
    """Return the formula in which the threshold has this value; SpecError if it does not fit the problem."""
    try:
        stated = requirement_of(stated_at(vary, threshold))
        return formula_of(stated, problem.info, problem.experiment, key="")
    except SpecError as error:
        place = f"{_stated()} with {LIMIT} = {threshold:g}"
        raise SpecError(error.message, file=place, key=error.key) from None


def _stated() -> str:
    return written("--stl", "vary")


@dataclass(slots=True)
class _Bisection:
    """The state of a search among thresholds, the easiest to violate first: everything simulated so far."""

    problem: Problem
    vary: str
    engine: str
    budget: int
    seed: int
    searched: OnSearch
    thresholds: list[float]
    reached: int = -1  # the hardest that was falsified
    in_vain: set[int] = field(default_factory=set)
    history: list[Evaluation] = field(default_factory=list)
    searches: list[tuple[float, bool]] = field(default_factory=list)
    # Whether a violation was confirmed, by threshold and candidate.
    confirmed: dict[tuple[int, object], bool] = field(default_factory=dict)

    @property
    def close(self) -> int:
        """How many thresholds may lie between the two that are told, and one."""
        return max(1, floor(RESOLUTION * (len(self.thresholds) - 1)))

    @property
    def hard(self) -> int:
        """The easiest that was searched in vain and not reached since; beyond the last: none."""
        return min((k for k in self.in_vain if k > self.reached), default=len(self.thresholds))

    def narrowed(self) -> bool:
        """Search at both ends, then between the hardest falsified threshold and the easiest other one.

        Returns:
            Whether that is all there is to know; False: the budget is used up before.
        """
        self._search(len(self.thresholds) - 1, 2 + ceil(log2(1 / RESOLUTION)))
        if self.reached < 0:
            self._search(0, 1)  # it ends with the first violation; without one there is nothing to narrow
        while 0 <= self.reached < self.hard - self.close:
            if len(self.history) >= self.budget:
                return False
            self._search((self.reached + self.hard) // 2, ceil(log2((self.hard - self.reached) / self.close)))
        return True

    def _search(self, k: int, searches: int) -> None:
        """Search at a threshold with its share of what is left of the budget; keep what that says."""
        problem, budget = self._at(k), (self.budget - len(self.history)) // max(searches, 1)
        engine = make_engine(self.engine, problem, seed=self.seed + len(self.searches))
        if self.history:
            engine.tell(self._judged(k))

        def remember(event: Event) -> None:
            if isinstance(event, Evaluated):
                self.history.append(event.evaluation)

        (result,) = search([problem], [engine], Budget(max(1, budget)), listeners=[remember])
        if result.status == "interrupted":
            raise KeyboardInterrupt
        self.searches.append((self.thresholds[k], result.falsified))
        if result.falsified:
            self.reached = max(self.reached, k)
        else:
            self.in_vain.add(k)
        self.judge_all()
        self.searched(*self.searches[-1], len(self.history))

    def _at(self, k: int) -> Problem:
        """Return the problem with the formula that has this threshold."""
        formula = formula_at(self.problem, self.vary, self.thresholds[k])
        return replace(self.problem.with_requirement(formula), source=None)

    def _judged(self, k: int) -> list[Evaluation]:
        problem = self._at(k)
        return [judge(problem, evaluation) for evaluation in self.history]

    def judge_all(self) -> None:
        """Look for a harder threshold that something simulated already violates, if that is confirmed.

        Of the hardest one, the violation is slight and may be fragile; then for an easier one.
        """
        harder = range(self.reached + 1, len(self.thresholds))
        violated = harder[
            : bisect_left(harder, 1, key=lambda k: not any(e.violated for e in self._judged(k)))
        ]
        some = [k for k in violated if k % self.close == 0 or k == self.hard]
        if not violated or self._is_confirmed(violated[-1]):
            self.reached += len(violated)
        elif count := bisect_left(some, 1, key=lambda k: not self._is_confirmed(k)):
            self.reached = some[count - 1]

    def _is_confirmed(self, k: int) -> bool:
        problem = self._at(k)
        found = [(e.robustness, e) for e in self._judged(k) if e.robustness is not None and e.violated]
        for _, evaluation in sorted(found, key=lambda pair: pair[0])[:_TRIED]:
            key = k, evaluation.candidate.key
            if key not in self.confirmed:
                self.confirmed[key] = confirm(problem, evaluation).outcome == "confirmed"
            if self.confirmed[key]:
                return True
        return False
