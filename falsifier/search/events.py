"""Events of a run: values for the journal, displays and callbacks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from falsifier.core.candidate import Candidate
from falsifier.core.space import SearchSpace
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.messages import Exchange
from falsifier.problem.problem import Problem
from falsifier.search.budget import Budget, Spent
from falsifier.search.result import Result, ResultStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class RunStarted:
    """A run starts or is resumed.

    Attributes:
        problems: what is searched; they differ only in their requirement.
        engines: name of each problem's engine.
        budget: limits of the run.
        searched: the part of the search space that the engines use.
        server: address to which prompts go, if it is not the provider's own.
        replayed: number of evaluations taken from the run's journal.
    """

    problems: tuple[Problem, ...]
    engines: tuple[str, ...]
    budget: Budget
    searched: SearchSpace
    server: str = ""
    replayed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """An engine was asked for candidates.

    Attributes:
        first: index that the evaluation of the first candidate will have.
        wanted: number of candidates asked for.
        candidates: what the engine suggested.
        seconds: how long it took.
        problem: the problem that the engine works on.
        spent: what the run has spent so far.
    """

    first: int
    wanted: int
    candidates: tuple[Candidate, ...]
    seconds: float
    problem: Problem
    spent: Spent


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchanged:
    """A request was sent to a language model and answered."""

    exchange: Exchange
    spent: Spent


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluated:
    """A candidate was simulated and judged.

    Attributes:
        index: index of the evaluation.
        problem: the problem whose engine suggested the candidate.
        evaluation: judged against that problem's requirement.
        judged: the same simulation judged against each requirement not yet falsified, by name.
        improved: whether it is the best so far for any of these requirements.
        best: best evaluation of ``problem`` so far.
        spent: what the run has spent so far.
        replayed: whether it was taken from the run's journal.
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
        index: index of the evaluation that violates.
        confirmation: the result.
        spent: what the run has spent so far.
    """

    index: int
    confirmation: Confirmation
    spent: Spent


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEnded:
    """The run has ended.

    Attributes:
        status: of all requirements together.
        reason: why it ended, in words.
        results: one per problem.
        spent: what the run has spent in total.
    """

    status: ResultStatus
    reason: str
    results: tuple[Result, ...]
    spent: Spent


Event = RunStarted | Asked | Exchanged | Evaluated | Confirmed | RunEnded
Listener = Callable[[Event], None]
