"""An engine for tests to change, and a user who stops a search."""

from collections.abc import Sequence

from falsifier.core.candidate import Candidate
from falsifier.engines import make_engine
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.search.events import Evaluated, Event, Listener


class Wrapped:
    """Does what one of the bundled engines does."""

    name = "wrapped"

    def __init__(self, problem: Problem, seed: int = 0, *, inner: str = "uniform") -> None:
        self.inner = make_engine(inner, problem, seed=seed)

    def ask(self, n: int = 1) -> list[Candidate]:
        return self.inner.ask(n)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self.inner.tell(evaluations)


def stop_after(count: int) -> list[Listener]:
    """Listeners through which the user stops a run once so many simulations are evaluated."""

    def stop(event: Event) -> None:
        if isinstance(event, Evaluated) and event.index + 1 == count:
            raise KeyboardInterrupt

    return [stop]
