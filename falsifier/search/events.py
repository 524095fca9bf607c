"""What happens in a run, as values that displays and callbacks read."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.search.budget import Budget, Spent
from falsifier.search.result import Result

if TYPE_CHECKING:
    from falsifier.llm.messages import Exchange


@dataclass(frozen=True, slots=True)
class RunStarted:
    """A run begins, or goes on after ``replayed`` evaluations from its journal."""

    problem: Problem
    engine: str
    budget: Budget
    replayed: int = 0


@dataclass(frozen=True, slots=True)
class Exchanged:
    """A language model was asked and answered."""

    exchange: "Exchange"
    spent: Spent


@dataclass(frozen=True, slots=True)
class Evaluated:
    """One more candidate was simulated and judged."""

    index: int
    evaluation: Evaluation
    best: Evaluation | None
    spent: Spent
    replayed: bool = False


@dataclass(frozen=True, slots=True)
class Confirmed:
    """A violation was simulated again and judged by a second monitor."""

    confirmation: Confirmation


@dataclass(frozen=True, slots=True)
class RunEnded:
    """The run is over."""

    result: Result


Event = RunStarted | Exchanged | Evaluated | Confirmed | RunEnded
Listener = Callable[[Event], None]
