"""An engine that makes conditions true which never held, so that what they guard is tested at all.

A requirement such as ``G (speed >= 200 -> x <= 5)`` holds as long as its condition never does, and then the
robustness may be decided by the consequence, whose margin says nothing about how to reach the condition. A
second engine of the same kind therefore searches for a violation of ``G not (speed >= 200)`` and takes every
other turn, until the condition has held once.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from falsifier.core.candidate import Candidate
from falsifier.engines.protocol import Engine
from falsifier.evaluation.evaluate import Evaluation, judge, monitor_for
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl.extremes import Watched
from falsifier.stl.formula import Always, Formula, Implies, Not, Or, Window

# Simulations in which a condition never held before it is aimed at. The engine's own opening comes first: it
# reaches most conditions (design/search.md).
PATIENCE = 10
# Evaluations that a second engine is told when it begins; trajectories of more would fill the memory.
_KEPT = 20


@dataclass(slots=True)
class _Aim:
    """A condition to make true, as the requirement that it never is.

    Attributes:
        text: what to make true.
        problem: the problem with the requirement that this never is.
        nearest: smallest robustness of that requirement so far: how false it was at the closest.
    """

    text: str
    problem: Problem
    nearest: float | None = None

    @property
    def reached(self) -> bool:
        """Whether the condition has held."""
        return self.nearest is not None and self.nearest <= 0

    def judged(self, evaluation: Evaluation) -> Evaluation:
        """Judge a simulation by whether the condition never held; without a trajectory nobody knows."""
        if evaluation.trajectory is None:
            return replace(evaluation, verdict=None)
        return judge(self.problem, evaluation)


class Aiming:
    """Takes turns with a second engine that aims at a condition of the requirement that never held.

    Args:
        engine: searches for a violation of the requirement.
        problem: the problem with the requirement.
        make: makes another engine of the same kind for a problem.
    """

    def __init__(self, engine: Engine, problem: Problem, make: Callable[[Problem], Engine]) -> None:
        self.engine = engine
        self._make = make
        self._aims = list(_aims(problem))
        self._recent: deque[Evaluation] = deque(maxlen=_KEPT)
        self._judged = self._turns = 0
        self._aim: _Aim | None = None
        self._aimer: Engine | None = None

    @property
    def name(self) -> str:
        """Name of the first engine."""
        return self.engine.name

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return candidates of the first engine, and every other one of the second while there is an aim."""
        self._begin()
        if self._aimer is None:
            return self.engine.ask(n)
        return [self._ask_one(self._aimer) for _ in range(max(n, 1))]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Tell both engines, and note how near each condition came."""
        self.engine.tell(evaluations)
        if all(aim.reached for aim in self._aims):
            self._recent.clear()
            return
        self._recent.extend(evaluations)
        self._judged += sum(e.verdict is not None for e in evaluations)
        if self._aimer is not None and self._aim is not None:
            self._aimer.tell([self._aim.judged(e) for e in evaluations])
        for aim in self._aims:
            if not aim.reached:
                found = [aim.judged(e).robustness for e in evaluations]
                known = [r for r in (*found, aim.nearest) if r is not None]
                aim.nearest = min(known, default=None)
        if self._aim is not None and self._aim.reached:
            self._aim = self._aimer = None

    def _begin(self) -> None:
        """Choose an aim if the simulations so far missed one."""
        missed = [aim for aim in self._aims if not aim.reached]
        if self._aimer is not None or self._judged < PATIENCE or not missed:
            return
        self._aim = missed[0]
        self._aimer = self._make(self._aim.problem)
        self._aimer.tell([self._aim.judged(e) for e in self._recent])

    def _ask_one(self, aimer: Engine) -> Candidate:
        self._turns += 1
        if self._turns % 2 == 0 or self._aim is None:
            return self.engine.ask(1)[0]
        candidate = aimer.ask(1)[0]
        missing = "" if self._aim.nearest is None else f", at the closest missed by {self._aim.nearest:.6g}"
        return replace(
            candidate,
            aim=self._aim.text,
            rationale=f"aims at {self._aim.text}{missing}: {candidate.rationale}",
        )


def can_aim(problem: Problem) -> bool:
    """Whether a requirement has conditions that may never hold."""
    return any(True for _ in _aims(problem))


def _aims(problem: Problem) -> Iterator[_Aim]:
    """Yield the conditions of implications and the failures of sides of disjunctions, outermost first."""
    step = problem.experiment.output_interval
    known: set[Formula] = set()
    for watched in monitor_for(problem).watched:
        never = _never(watched, step)
        if never is not None and never not in known:
            known.add(never)
            wanted = (
                watched.part.formula if isinstance(watched.formula, Implies) else Not(watched.part.formula)
            )
            requirement = Requirement(problem.name, never)
            yield _Aim(str(wanted), replace(problem, requirement=requirement, source=None))


def _never(watched: Watched, step: float) -> Formula | None:
    """Return the formula that is violated once a condition holds, or a side of a disjunction fails."""
    window = Window(watched.first * step, watched.last * step)
    match watched.formula:
        case Implies():
            return Always(Not(watched.part.formula), window)
        case Or():
            return Always(watched.part.formula, window)
        case _:
            return None
