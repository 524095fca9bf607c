"""Candidates: the same thing whoever proposed them, input signals and parameter values by name."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from falsifier.core.signals import Signal


@dataclass(frozen=True, slots=True)
class Candidate:
    """One proposed simulation.

    Attributes:
        signals: input signals by name.
        parameters: parameter values by name.
        origin: who proposed it.
        rationale: why, in the engine's words.
    """

    signals: Mapping[str, Signal] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    origin: str = ""
    rationale: str = ""

    @property
    def key(self) -> tuple[object, ...]:
        """What is simulated, without origin and rationale: equal keys are equal simulations."""
        return (
            tuple(sorted(self.signals.items(), key=lambda kv: kv[0])),
            tuple(sorted(self.parameters.items())),
        )

    def to_json(self) -> dict[str, Any]:
        """Plain form for journals and exports."""
        return {
            "signals": {
                name: {
                    "times": list(s.times),
                    "values": list(s.values),
                    "interpolation": s.interpolation,
                    "hold": s.hold,
                }
                for name, s in self.signals.items()
            },
            "parameters": dict(self.parameters),
            "origin": self.origin,
            "rationale": self.rationale,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "Candidate":
        """Candidate from its plain form."""
        return cls(
            {
                name: Signal(tuple(s["times"]), tuple(s["values"]), s["interpolation"], s.get("hold"))
                for name, s in data.get("signals", {}).items()
            },
            {name: float(v) for name, v in data.get("parameters", {}).items()},
            data.get("origin", ""),
            data.get("rationale", ""),
        )
