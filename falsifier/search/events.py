"""What happens in a run, as values that the journal, displays and callbacks read."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from falsifier.core.candidate import Candidate
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.messages import Exchange
from falsifier.problem.problem import Problem
from falsifier.search.budget import Budget, Spent
from falsifier.search.result import Result, ResultStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class RunStarted:
    """A run begins, or continues.

    Attributes:
        problems: what is searched; they differ in their requirement only.
        engines: name of each problem's engine.
        budget: limits.
        replayed: how many evaluations come from the run's journal.
    """

    problems: tuple[Problem, ...]
    engines: tuple[str, ...]
    budget: Budget
    replayed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """An engine was asked for candidates.

    Attributes:
        first: index of the evaluation that the first candidate becomes.
        wanted: how many were asked for.
        candidates: what it gave.
        seconds: how long it took.
        problem: whose turn it was.
    """

    first: int
    wanted: int
    candidates: tuple[Candidate, ...]
    seconds: float
    problem: Problem


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchanged:
    """A language model was asked and answered."""

    exchange: Exchange
    spent: Spent


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluated:
    """One more candidate was simulated and judged.

    Attributes:
        index: of the evaluation.
        problem: whose turn it was.
        evaluation: judged by that problem's requirement.
        judged: the same judged by each requirement that was not falsified yet, by its name.
        improved: whether it is the best so far for any of them.
        best: the best evaluation so far of the problem whose turn it was.
        spent: by now.
        replayed: whether it comes from the run's journal.
    """

    index: int
    problem: Problem
    evaluation: Evaluation
    judged: Mapping[str, Evaluation]
    improved: bool
    best: Evaluation | None
    spent: Spent
    replayed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmed:
    """A violation was simulated again and judged by a second monitor.

    Attributes:
        index: of the evaluation that violates.
        confirmation: what came of it.
        spent: by now.
    """

    index: int
    confirmation: Confirmation
    spent: Spent


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEnded:
    """The run is over.

    Attributes:
        status: of all requirements together.
        reason: in words.
        results: one for each problem.
        spent: in all.
    """

    status: ResultStatus
    reason: str
    results: tuple[Result, ...]
    spent: Spent


Event = RunStarted | Asked | Exchanged | Evaluated | Confirmed | RunEnded
Listener = Callable[[Event], None]
