"""The interface between the hybrid engine and a language model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from falsifier.core.candidate import Candidate
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.conversation import OnExchange
from falsifier.llm.messages import Chat
from falsifier.llm.tools import WhatIf
from falsifier.stl import Verdict


@dataclass(frozen=True, slots=True)
class Advice:
    """Answer to one question.

    Attributes:
        candidates: at least one, at most as many as requested.
        foresaw: whether the LLM requested and received predictions before it answered.
    """

    candidates: list[Candidate]
    foresaw: bool = False


class Adviser(Protocol):
    """A language model that advises a numerical engine."""

    @property
    def name(self) -> str:
        """Origin of its candidates."""
        ...

    def attach(self, on_exchange: OnExchange, wrap: Callable[[Chat], Chat]) -> None:
        """Connect to a run that counts, records and replays the exchanges, as ``AsksLLM.attach``."""
        ...

    def describe(self, candidate: Candidate) -> str:
        """Return a candidate in one line, with the names that the LLM knows, for notes."""
        ...

    def told(self, reason: str) -> str:
        """Return a reason of the numerical engine as the LLM may read it; empty if it may not."""
        ...

    def foretold(self, verdict: Verdict) -> str:
        """Return a predicted verdict in words, as far as the LLM may read it."""
        ...

    def propose(
        self,
        count: int,
        notes: Sequence[str] = (),
        *,
        what_if: WhatIf | None = None,
        dispensable: bool = False,
    ) -> Advice:
        """Ask one question; return at least one and at most ``count`` candidates.

        Args:
            count: number of candidates to request.
            notes: lines to add to the question, after problem and history.
            what_if: permission to request predictions before answering; ignored if the LLM does not support
                tools.
            dispensable: whether the search continues without an answer. A missing answer is then recorded, so
                that a resumed run continues in the same way.

        Raises:
            ChatError: if there is no valid answer.
        """
        ...

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Learn from evaluations, including those of other engines' candidates."""
        ...
