"""The protocol of all search engines: ask for candidates, tell evaluations."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:  # --help of commands lists engines, and needs nothing of these
    from falsifier.core.candidate import Candidate
    from falsifier.evaluation.confirm import Confirmation
    from falsifier.evaluation.evaluate import Evaluation
    from falsifier.llm.conversation import OnExchange
    from falsifier.llm.messages import Chat

# Origins of candidates that no engine chose: what a search starts from, and what stands for an LLM's answer.
KNOWN = "known"
RANDOM_CHANGE = "random change"


class Engine(Protocol):
    """Suggests the next candidates.

    An engine sees the search space, the requirement and evaluations, never the model. It is deterministic:
    the same seed and the same sequence of calls give the same candidates. Resuming a run depends on that.
    ``falsifier.testing.EngineContract`` tests these rules.
    """

    @property
    def name(self) -> str:
        """Origin of its candidates."""
        ...

    def ask(self, n: int = 1) -> "list[Candidate]":
        """Return n candidates (at least one) to simulate next.

        May be called again before the evaluations of earlier candidates have been told.
        """
        ...

    def tell(self, evaluations: "Sequence[Evaluation]") -> None:
        """Learn from evaluations, including failed ones and those of candidates that it did not propose."""
        ...


@runtime_checkable
class FollowsRun(Protocol):
    """An engine that wants to know more of its run than the evaluations."""

    def begin(self, simulations: int | None) -> None:
        """Be told the maximum number of simulations, before the first ``ask``; None: no limit."""
        ...

    def doubt(self, confirmation: "Confirmation") -> None:
        """Be told that a violation does not count, before its evaluation is told."""
        ...


@runtime_checkable
class HasRemarks(Protocol):
    """An engine that has something to say at the end of a run."""

    def remarks(self, evaluations: "Sequence[Evaluation]") -> tuple[str, ...]:
        """Return what a user should know of how it worked, one sentence each, given all evaluations."""
        ...


@runtime_checkable
class AsksLLM(Protocol):
    """An engine that asks a language model; a run counts, records and replays its exchanges."""

    def attach(self, on_exchange: "OnExchange", wrap: "Callable[[Chat], Chat]") -> None:
        """Connect the engine to a run, before its first ``ask``: report every exchange, use the wrapped chat.

        Args:
            on_exchange: called with every exchange, including rejected replies; may raise ChatError.
            wrap: returns the chat to use instead of the engine's own, which it is given.
        """
        ...
