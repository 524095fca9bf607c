"""The steps of the loop that touch the world: asking engines, simulating, confirming."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from time import perf_counter
from typing import Protocol

from falsifier.core.candidate import Candidate
from falsifier.core.space import SearchSpace
from falsifier.engines.protocol import Engine
from falsifier.errors import CandidateError, SpecError
from falsifier.evaluation.confirm import Confirmation, confirm
from falsifier.evaluation.evaluate import Evaluation
from falsifier.evaluation.workers import start
from falsifier.llm.messages import Chat
from falsifier.problem.problem import Problem
from falsifier.search.budget import Spent


class Steps(Protocol):
    """The steps that the loop delegates: carried out live, or taken from a record."""

    @property
    def replayed(self) -> int:
        """Number of evaluations taken from a record."""
        ...

    @property
    def seconds(self) -> float:
        """Wall-clock seconds of the recorded part of the run."""
        ...

    @property
    def unrepeated(self) -> Spent:
        """What the recorded part spent on questions to a language model that are not played back."""
        ...

    def ask(self, problem: Problem, engine: Engine, wanted: int) -> tuple[list[Candidate], int, float]:
        """Return an engine's admitted candidates, the number asked for, and the time that took in s."""
        ...

    def start(self, problem: Problem, candidates: Sequence[Candidate]) -> list[Callable[[], Evaluation]]:
        """Start to simulate candidates; return functions that wait for their evaluations, in order."""
        ...

    def tell(self, engine: Engine, evaluations: Sequence[Evaluation]) -> float:
        """Tell an engine; return the time that took in s."""
        ...

    def confirm(self, problem: Problem, evaluation: Evaluation, index: int) -> Confirmation:
        """Check a violation, given the index of its evaluation."""
        ...

    def chat(self, inner: Chat) -> Chat:
        """Return the chat that an engine should ask instead of its own."""
        ...


@dataclass(frozen=True, slots=True)
class Live:
    """Carries out every step.

    Attributes:
        executor: runs the simulations; None: this process.
    """

    executor: Executor | None = None
    replayed: int = 0
    seconds: float = 0.0
    unrepeated: Spent = field(default_factory=Spent)

    def ask(self, problem: Problem, engine: Engine, wanted: int) -> tuple[list[Candidate], int, float]:
        """Ask the engine, and measure the time."""
        started = perf_counter()
        candidates = proposals(engine, problem.space, wanted)
        return candidates, wanted, perf_counter() - started

    def start(self, problem: Problem, candidates: Sequence[Candidate]) -> list[Callable[[], Evaluation]]:
        """Simulate and judge on the executor."""
        return start(problem, candidates, self.executor)

    def tell(self, engine: Engine, evaluations: Sequence[Evaluation]) -> float:
        """Tell the engine, and measure the time."""
        started = perf_counter()
        engine.tell(evaluations)
        return perf_counter() - started

    def confirm(self, problem: Problem, evaluation: Evaluation, index: int) -> Confirmation:
        """Simulate again with a fresh instance; the index is for replay only."""
        return confirm(problem, evaluation)

    def chat(self, inner: Chat) -> Chat:
        """Return the engine's own chat."""
        return inner


def proposals(engine: Engine, space: SearchSpace, wanted: int) -> list[Candidate]:
    """Ask an engine, and return its candidates as they will be simulated.

    Args:
        engine: the engine, possibly made by the user.
        space: what may be varied.
        wanted: number of candidates to ask for.

    Raises:
        SpecError: if the engine returns something else than a list of candidates, none, or more than it was
            asked for.
        CandidateError: naming the engine and the input or parameter that is unknown, missing or outside its
            range.
    """
    candidates = engine.ask(wanted)
    if not isinstance(candidates, Sequence) or not all(isinstance(c, Candidate) for c in candidates):
        raise SpecError(
            f"engine {engine.name!r}: ask(n) must return a list of Candidate, got {repr(candidates)[:100]}"
        )
    if not candidates:
        raise SpecError(f"engine {engine.name!r} returned no candidate: ask(n) must return at least one")
    if len(candidates) > wanted:
        raise SpecError(
            f"engine {engine.name!r} returned {len(candidates)} candidates: ask({wanted}) must return "
            f"at most {wanted}"
        )
    try:
        return [space.admit(candidate) for candidate in candidates]
    except CandidateError as error:
        raise CandidateError(f"engine {engine.name!r}: {error}") from None
