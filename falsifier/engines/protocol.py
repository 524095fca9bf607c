"""What every search engine is: ask for candidates, tell it evaluations."""

from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

from falsifier.core.candidate import Candidate
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.conversation import OnExchange
from falsifier.llm.messages import Chat


class Engine(Protocol):
    """Suggests the next candidates.

    An engine sees the search space, the requirement and evaluations, never the model. It is deterministic:
    the same seed and the same sequence of calls give the same candidates, which is how runs resume.
    """

    @property
    def name(self) -> str:
        """What its candidates bear as origin."""
        ...

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n candidates (at least one) to simulate next, whether or not earlier ones were answered."""
        ...

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Learn from evaluations, also failed ones and ones of candidates that it never proposed."""
        ...


@runtime_checkable
class AsksLLM(Protocol):
    """An engine that asks a language model: the loop counts, records and replays what it is answered."""

    def attach(self, on_exchange: OnExchange, wrap: Callable[[Chat], Chat]) -> None:
        """Report every question and answer from now on, and ask the wrapped chat; called before a run.

        Args:
            on_exchange: called with every exchange, rejected replies included; may raise ChatError.
            wrap: makes the chat to ask of the engine's own.
        """
        ...
