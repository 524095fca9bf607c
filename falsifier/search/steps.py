"""The steps of the loop that touch the world: asking engines, simulating, confirming."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from time import perf_counter

from falsifier.core.candidate import Candidate
from falsifier.core.space import SearchSpace
from falsifier.engines.protocol import Engine
from falsifier.errors import CandidateError, SpecError
from falsifier.evaluation.confirm import Confirmation, confirm
from falsifier.evaluation.evaluate import Evaluation
from falsifier.evaluation.workers import start
from falsifier.llm.messages import Exchange
from falsifier.problem.problem import Problem
from falsifier.search.budget import Spent


@dataclass
class Steps:
    """Carries out every step; a resumed run has others, which take what they can from its record."""

    executor: Executor | None = None  # runs the simulations; None: this process
    internals: tuple[str, ...] = ()  # internal variables to record, too; no part of what is found
    replayed: int = 0  # number of evaluations taken from a record
    seconds: float = 0.0  # wall-clock seconds of the recorded part of the run
    # Recorded exchanges with a language model, which are played back first.
    exchanges: Iterator[Exchange] = field(default_factory=lambda: iter(()))
    # What had been spent when a violation was confirmed, by evaluation index and requirement, as recorded.
    spent: Mapping[tuple[int, str], Spent] = field(default_factory=dict)
    # What the recorded part spent on questions to a language model that are not played back.
    unrepeated: Spent = field(default_factory=Spent)

    def ask(self, problem: Problem, engine: Engine, wanted: int) -> tuple[list[Candidate], int, float]:
        """Return an engine's admitted candidates, the number asked for, and the time that took in s."""
        started = perf_counter()
        return proposals(engine, problem.space, wanted), wanted, perf_counter() - started

    def start(self, problem: Problem, candidates: Sequence[Candidate]) -> list[Callable[[], Evaluation]]:
        """Start to simulate and judge; return functions that wait for the evaluations, in order."""
        return start(problem.watching(self.internals), candidates, self.executor)

    def tell(self, engine: Engine, evaluations: Sequence[Evaluation]) -> float:
        """Tell an engine; return the time that took in s."""
        started = perf_counter()
        engine.tell(evaluations)
        return perf_counter() - started

    def confirm(self, problem: Problem, evaluation: Evaluation, index: int) -> Confirmation:
        """Check a violation with a fresh instance; the index of its evaluation is for replay only."""
        return confirm(problem, evaluation)


def proposals(engine: Engine, space: SearchSpace, wanted: int) -> list[Candidate]:
    """Ask an engine, and return its candidates as they will be simulated.

    Raises:
        SpecError: if the engine returns something else than a list of candidates, none, or more than wanted.
        CandidateError: naming the engine and the input or parameter that is unknown, missing or out of range.
    """
    try:
        candidates = engine.ask(wanted)
    except SpecError as error:  # such as a signal with NaN
        raise SpecError(f"engine {engine.name!r}: {error}") from error
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
