"""One candidate in, one evaluation out."""

from dataclasses import dataclass
from typing import Literal

from falsifier.space import Candidate
from falsifier.stl.verdict import Verdict
from falsifier.trajectory import Trajectory

Status = Literal["ok", "failed", "crashed", "timeout"]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A candidate with its verdict, or the reason why there is none.

    Attributes:
        candidate: what was simulated.
        status: ``ok``, or how the simulation ended instead.
        verdict: robustness and what decided it; None unless the status is ok.
        reason: why there is no verdict, empty otherwise.
        trajectory: outputs, then inputs, on the output grid; None unless the status is ok.
        seconds: wall-clock time of the simulation.
        log: messages of the model.
    """

    candidate: Candidate
    status: Status = "ok"
    verdict: Verdict | None = None
    reason: str = ""
    trajectory: Trajectory | None = None
    seconds: float = 0.0
    log: tuple[str, ...] = ()

    @property
    def robustness(self) -> float | None:
        """Robustness, or None without a verdict."""
        return None if self.verdict is None else self.verdict.robustness

    @property
    def violated(self) -> bool:
        """Whether the requirement is violated; a failed simulation violates nothing."""
        return self.verdict is not None and self.verdict.violated
