"""An engine that proposes known candidates before those of another engine."""

from collections import deque
from collections.abc import Callable, Sequence

from falsifier.core.candidate import Candidate
from falsifier.engines.protocol import AsksLLM, Engine, FollowsRun, HasRemarks
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.conversation import OnExchange
from falsifier.llm.messages import Chat

# Origin of candidates that a search starts from.
KNOWN = "known"


class KnownFirst:
    """Proposes known candidates first, then what another engine suggests, which learns from all of them.

    Args:
        engine: the other engine.
        known: the candidates that are left; engines that search together share it, so that each candidate is
            proposed once.
    """

    def __init__(self, engine: Engine, known: deque[Candidate]) -> None:
        self.engine = engine
        self.known = known

    @property
    def name(self) -> str:
        """Name of the other engine."""
        return self.engine.name

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return known candidates as long as there are any, then those of the other engine."""
        if self.known:
            return [self.known.popleft() for _ in range(min(max(n, 1), len(self.known)))]
        return self.engine.ask(n)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Tell the other engine."""
        self.engine.tell(evaluations)

    def begin(self, simulations: int | None) -> None:
        """Tell the other engine the maximum number of simulations if it wants to know."""
        if isinstance(self.engine, FollowsRun):
            self.engine.begin(simulations)

    def doubt(self, confirmation: Confirmation) -> None:
        """Tell the other engine that a violation does not count if it wants to know."""
        if isinstance(self.engine, FollowsRun):
            self.engine.doubt(confirmation)

    def remarks(self, evaluations: Sequence[Evaluation]) -> tuple[str, ...]:
        """Return the remarks of the other engine."""
        return self.engine.remarks(evaluations) if isinstance(self.engine, HasRemarks) else ()

    def attach(self, on_exchange: OnExchange, wrap: Callable[[Chat], Chat]) -> None:
        """Connect the other engine to a run if it asks a language model."""
        if isinstance(self.engine, AsksLLM):
            self.engine.attach(on_exchange, wrap)
