"""What a search that found nothing could not show, so that its answer is not taken for more than it says."""

from dataclasses import dataclass
from typing import Literal

# parameterization: only fixed control points were searched; condition: that of an implication never held;
# disjunct: one side of an ``or`` always held; threshold: a predicate was never near its threshold;
# constant: the robustness was the same in all simulations; effect: an input or parameter had none.
FindingKind = Literal["parameterization", "condition", "disjunct", "threshold", "constant", "effect"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that a search could not show.

    Attributes:
        kind: what it is about.
        text: what it is, and what would have to happen, in words.
        part: the part of the formula, or the input or parameter, that it is about; empty if it is about none.
        margin: how far the part was from changing its truth; None if that has no meaning.
        time: when it came closest, in s; None if that has no meaning.
        simulation: index of the evaluation in which it came closest; None if that has no meaning.
    """

    kind: FindingKind
    text: str
    part: str = ""
    margin: float | None = None
    time: float | None = None
    simulation: int | None = None

    @property
    def vacuous(self) -> bool:
        """Whether a part of the requirement was not tested, so that the answer says less than it seems to."""
        return self.kind not in ("parameterization", "effect")

    @property
    def untested(self) -> bool:
        """Whether a part of the requirement never had a say, or nothing moved it; not: a wide margin."""
        return self.kind in ("condition", "disjunct", "constant")
