"""What was simulated in place of a language model's answers, and why, for the end of a run."""

from collections import Counter
from collections.abc import Hashable, Sequence
from textwrap import shorten

from falsifier.core.candidate import Candidate
from falsifier.core.words import counted
from falsifier.evaluation.evaluate import Evaluation

# Origin of candidates that are simulated in place of a single answer.
RANDOM_CHANGE = "random change"
# Characters of a reason: rejected replies are quoted in it, and what is wrong stands at the beginning.
_LONGEST_REASON = 240


class StandIns:
    """Knows what proposed candidates in place of a language model."""

    def __init__(self) -> None:
        self._proposed: dict[Hashable, str] = {}
        self._reasons: dict[str, str] = {}

    def because(self, source: str, reason: object) -> None:
        """Note why a source stands in; the first reason is kept."""
        self._reasons.setdefault(source, shorten(str(reason), _LONGEST_REASON, placeholder=" ..."))

    def proposed(self, source: str, candidates: Sequence[Candidate]) -> None:
        """Note what a source proposes."""
        self._proposed |= dict.fromkeys((c.key for c in candidates), source)

    def remarks(self, evaluations: Sequence[Evaluation]) -> tuple[str, ...]:
        """Return one sentence per source that proposed some of these evaluations' candidates."""
        sources = [self._proposed.get(e.candidate.key, "") for e in evaluations]
        counts = Counter(source for source in sources if source)
        return tuple(
            f"{count} of {counted(len(sources), 'sample')} from {source}, because {self._reasons[source]}"
            for source, count in counts.items()
        )
