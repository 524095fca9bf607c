"""What the hybrid engine asks of a language model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from falsifier.core.candidate import Candidate
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.conversation import OnExchange
from falsifier.llm.messages import Chat
from falsifier.llm.tools import WhatIf


@dataclass(frozen=True, slots=True)
class Advice:
    """What one question brought.

    Attributes:
        candidates: at least one, as many as were asked for at most.
        foresaw: whether the LLM asked for predictions, and got some, before it answered.
    """

    candidates: list[Candidate]
    foresaw: bool = False


class Adviser(Protocol):
    """The language model's side."""

    @property
    def name(self) -> str:
        """What its candidates bear as origin."""
        ...

    def attach(self, on_exchange: OnExchange, wrap: Callable[[Chat], Chat]) -> None:
        """See AsksLLM.attach."""
        ...

    def describe(self, candidate: Candidate) -> str:
        """A candidate in a few words and by the names that the LLM knows, for notes."""
        ...

    def propose(
        self,
        count: int,
        notes: Sequence[str] = (),
        *,
        what_if: WhatIf | None = None,
        dispensable: bool = False,
    ) -> Advice:
        """Return up to ``count`` candidates, at least one, after a single question.

        Args:
            count: how many are wanted.
            notes: lines that the question carries beside problem and history.
            what_if: leave to ask for predictions in between; an LLM that takes no tools goes without.
            dispensable: the search goes on where no answer comes. That none came is put on record then, so
                that a resumed run goes on in the same way.

        Raises:
            ChatError: when no valid answer can be had.
        """
        ...

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Learn from evaluations, whoever proposed their candidates."""
        ...
