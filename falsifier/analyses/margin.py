"""Where a requirement starts to be violated: the threshold between what was falsified and what was not."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import ceil, inf, log2
from numbers import Real

from falsifier.core.arguments import instance, list_of, whole
from falsifier.core.words import counted
from falsifier.engines import DEFAULT_ENGINE, make_engine
from falsifier.errors import SimulationError, SpecError, written
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import Evaluation, judge
from falsifier.problem.problem import Problem, check_problem
from falsifier.problem.requirement import Requirement, parse_requirement
from falsifier.search.budget import Budget
from falsifier.search.events import Evaluated, Event
from falsifier.search.loop import search

LIMIT = "{limit}"
# The search ends when the threshold is known to this share of the range.
RESOLUTION = 0.01
# Steps of the bisection over what is simulated already: more than a threshold has significant digits.
_JUDGED_STEPS = 20

OnSearch = Callable[[float, bool, int], None]


@dataclass(frozen=True, slots=True)
class Margin:
    """Between which thresholds a requirement starts to be violated.

    Attributes:
        falsified: threshold nearest to the other one with a confirmed violation; None if there was none.
        unfalsified: threshold nearest to it at which a search found nothing; None if all were falsified.
        simulations: number of simulations of all searches together, without confirmations.
        searches: the thresholds that were searched, in order, and whether a violation was confirmed.
        complete: whether the two are close enough; False: the budget was used up before.
        interrupted: whether the user stopped it; the thresholds are what was known by then.
    """

    falsified: float | None
    unfalsified: float | None
    simulations: int
    searches: tuple[tuple[float, bool], ...]
    complete: bool
    interrupted: bool = False

    @property
    def text(self) -> str:
        """The result in one sentence."""
        searches = "1 search" if len(self.searches) == 1 else f"{len(self.searches)} searches"
        effort = f"({counted(self.simulations, 'simulation')}, {searches})"
        ends = [] if self.falsified is None else [f"falsified at {self.falsified:.6g}"]
        ends += [] if self.unfalsified is None else [f"not falsified at {self.unfalsified:.6g}"]
        if self.interrupted:
            return f"{', '.join(ends) or 'nothing is known yet'} {effort}; stopped by the user"
        if self.unfalsified is None:
            ends = [f"falsified in the whole range, even at {self.falsified:.6g}"]
        elif self.falsified is None:
            ends = [f"not falsified in the whole range, not even at {self.unfalsified:.6g}"]
        more = "" if self.complete else "; a larger budget narrows it"
        return f"{', '.join(ends)} {effort}{more}"


def margin(
    problem: Problem,
    vary: str,
    between: tuple[float, float],
    *,
    engine: str = DEFAULT_ENGINE,
    budget: int = 300,
    seed: int = 0,
    searched: OnSearch | None = None,
) -> Margin:
    """Find the threshold at which a search starts to find violations, by bisection.

    Robustness must change in one direction with the threshold. All searches share their simulations: each is
    judged for every threshold.

    Args:
        problem: the model and what may be varied; its requirement is replaced.
        vary: formula with ``{limit}`` in place of the threshold.
        between: smallest and largest threshold.
        engine: name of the engine.
        budget: maximum number of simulations of all searches together.
        seed: seed of the engines.
        searched: called after each search with the threshold, whether it was falsified, and the number of
            simulations so far.

    Returns:
        The thresholds. Ctrl-C ends the searches early; then they are what was known by then.

    Raises:
        SpecError: if the formula, the range or a number is not valid, or the threshold changes nothing.
        SimulationError: if most simulations failed.
    """
    check_problem(problem)
    instance("vary", vary, str, "text")
    given = list_of("between", between, Real, "two numbers")
    if LIMIT not in vary:
        raise SpecError(f"vary: expected {LIMIT} in place of the threshold, got {vary!r}")
    if len(given) != 2 or not -inf < given[0] < given[1] < inf:
        raise SpecError(f"between: expected two numbers (LOW, HIGH) with LOW < HIGH, got {between!r}")
    low, high = given
    budget, seed = whole("budget", budget, least=20), whole("seed", seed, least=0)
    state = _Bisection(problem, vary, engine, budget, seed, searched or (lambda *_: None))
    easy, hard = state.directed(low, high)
    complete = interrupted = False
    try:
        complete = state.narrowed(easy, hard)
    except KeyboardInterrupt:
        interrupted = True
    searches, count = tuple(state.searches), len(state.history)
    return Margin(state.falsified, state.unfalsified, count, searches, complete, interrupted)


@dataclass(slots=True)
class _Bisection:
    """The state of a search for a threshold: everything that was simulated so far."""

    problem: Problem
    vary: str
    engine: str
    budget: int
    seed: int
    searched: OnSearch
    falsified: float | None = None
    unfalsified: float | None = None
    history: list[Evaluation] = field(default_factory=list)
    searches: list[tuple[float, bool]] = field(default_factory=list)

    def directed(self, low: float, high: float) -> tuple[float, float]:
        """Return the threshold that is easier to violate, then the other one, judged by one simulation."""
        self._search(high, 1)
        values = [e.robustness for x in (low, high) for e in self._judged(x) if e.robustness is not None]
        self.searches.clear()
        if len(values) < 2:
            raise SimulationError(f"{self.problem.name}: the simulation failed: {self.history[0].reason}")
        if values[0] == values[-1]:
            raise SpecError(
                f"{written('--stl', 'vary')}: the robustness is the same for {LIMIT} = {low:g} and {high:g}"
            )
        return (low, high) if values[0] < values[-1] else (high, low)

    def narrowed(self, easy: float, hard: float) -> bool:
        """Search at both ends, then between the hardest falsified threshold and the easiest other one.

        Returns:
            Whether that is all there is to know; False: the budget is used up before.
        """
        close = RESOLUTION * abs(hard - easy)
        steps = 2 + ceil(log2(1 / RESOLUTION))
        if self._falsified(hard, steps):
            return True
        reached = self._reached(easy, hard)
        if reached is None:
            if not self._falsified(easy, steps - 1):
                return True
            reached = self._reached(easy, hard) or easy
        easy = self.falsified = reached
        while abs(hard - easy) > close and len(self.history) < self.budget:
            middle = (easy + hard) / 2
            if self._falsified(middle, ceil(log2(abs(hard - easy) / close))):
                easy = self.falsified = self._reached(middle, hard) or middle
            else:
                hard = middle
        return abs(hard - easy) <= close

    def _falsified(self, threshold: float, searches: int) -> bool:
        """Search at a threshold with its share of what is left of the budget; keep what that says."""
        found = self._search(threshold, max(1, (self.budget - len(self.history)) // max(searches, 1)))
        if found:
            self.falsified = threshold
        else:
            self.unfalsified = threshold
        self.searched(threshold, found, len(self.history))
        return found

    def _search(self, threshold: float, budget: int) -> bool:
        problem = self._at(threshold)
        engine = make_engine(self.engine, problem, seed=self.seed + len(self.searches))
        if self.history:
            engine.tell(self._judged(threshold))

        def remember(event: Event) -> None:
            if isinstance(event, Evaluated):
                self.history.append(event.evaluation)

        (result,) = search([problem], [engine], Budget(budget), listeners=[remember])
        if result.status == "interrupted":
            raise KeyboardInterrupt
        if result.status == "failed":
            raise SimulationError(f"{problem.name}: {result.reason}")
        self.searches.append((threshold, result.falsified))
        return result.falsified

    def _at(self, threshold: float) -> Problem:
        """Return the problem with the formula in which the threshold has this value."""
        problem, text = self.problem, self.vary.replace(LIMIT, f"{threshold:.12g}")
        formula = parse_requirement(text, problem.info, problem.experiment)
        return replace(problem, requirement=Requirement(problem.name, formula), source=None)

    def _judged(self, threshold: float) -> list[Evaluation]:
        problem = self._at(threshold)
        return [judge(problem, evaluation) for evaluation in self.history]

    def _reached(self, easy: float, hard: float) -> float | None:
        """Return the hardest threshold that something simulated already violates, if that is confirmed."""
        found, threshold = None, easy
        for _ in range(_JUDGED_STEPS + 1):
            violating = [e for e in self._judged(threshold) if e.violated]
            if violating:
                easy, found = threshold, min(violating, key=lambda e: e.robustness or 0.0)
            elif found is None:
                return None
            else:
                hard = threshold
            threshold = (easy + hard) / 2
        assert found is not None, "there is at least one step"
        confirmation = confirm(self._at(easy), found)
        return easy if confirmation.outcome == "confirmed" else None
