"""Verdicts: the result of monitoring one trajectory."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from falsifier.stl.breach import Breach


@dataclass(frozen=True, slots=True)
class Verdict:
    """Robustness of a requirement on one trajectory, and what decided it.

    Attributes:
        robustness: signed margin at time 0; < 0 is a violation, and nothing else is. A margin of exactly 0
            is given as -1e-300 if the requirement is violated, and as 1e-300 if it holds.
        critical_time: time in s that decided the value.
        predicate: text of the deciding predicate.
        values: signal values at the critical time, by name.
        breach: what broke; None if nothing did.
    """

    robustness: float
    critical_time: float
    predicate: str
    values: Mapping[str, float] = field(default_factory=dict)
    breach: Breach | None = None

    @property
    def moment(self) -> float:
        """Time in s to look at: when what broke was farthest off; without a violation, the critical time."""
        return self.breach.main.time if self.breach else self.critical_time

    @property
    def violated(self) -> bool:
        """Whether the requirement is violated."""
        return self.robustness < 0
