"""What every search engine is: ask for candidates, tell it evaluations."""

from collections.abc import Sequence
from typing import Protocol

from falsifier.core.candidate import Candidate
from falsifier.evaluation.evaluate import Evaluation


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
