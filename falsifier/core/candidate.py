"""Candidates: input signals and parameter values by name, in the same form for every engine."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from falsifier.core.arguments import finite, instance
from falsifier.core.fixed import FixedDict
from falsifier.core.signals import Signal
from falsifier.errors import SpecError, in_section

# Parts of a signal; every candidate is recorded, and dataclasses.asdict takes many times as long.
_PARTS = tuple(part.name for part in fields(Signal))


@dataclass(frozen=True, slots=True)
class Candidate:
    """One proposed simulation, read-only.

    Attributes:
        signals: input signals by name.
        parameters: parameter values by name.
        origin: name of the engine that proposed it.
        rationale: the engine's reason for proposing it.

    Raises:
        SpecError: naming what is no signal, or no finite number.
    """

    signals: Mapping[str, Signal] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    origin: str = ""
    rationale: str = ""

    def __post_init__(self) -> None:
        for what, values in (("signals", self.signals), ("parameters", self.parameters)):
            instance(what, values, Mapping, f"{what} by name")
            object.__setattr__(self, what, FixedDict(values))
        for name, signal in self.signals.items():
            instance(f"signals, {name!r}", signal, Signal, "a Signal")
        # As of signals: JSON has no numbers of numpy.
        numbers = {n: finite(f"parameters, {n!r}", v) for n, v in self.parameters.items()}
        object.__setattr__(self, "parameters", FixedDict(numbers))

    @property
    def key(self) -> tuple[object, ...]:
        """Signals and parameters without origin and rationale: equal keys give equal simulations."""
        return tuple(sorted(self.signals.items())), tuple(sorted(self.parameters.items()))

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form used in journals and exports."""
        return {
            "signals": {
                name: {part: getattr(signal, part) for part in _PARTS}
                for name, signal in self.signals.items()
            },
            "parameters": dict(self.parameters),
            "origin": self.origin,
            "rationale": self.rationale,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "Candidate":
        """Return the candidate that ``to_json`` wrote; SpecError naming the key that was changed and how."""
        for what in ("signals", "parameters"):
            instance(what, data.get(what, {}), Mapping, f"{what} by name")
        signals = {}
        for name, s in data.get("signals", {}).items():
            with in_section(key=f"signals.{name}"):
                try:
                    points = tuple(s["times"]), tuple(s["values"])
                    signals[name] = Signal(*points, s["interpolation"], s.get("hold"))
                except (KeyError, TypeError):
                    raise SpecError("expected times, values and interpolation") from None
        parameters = {n: finite(f"parameters.{n}", v) for n, v in data.get("parameters", {}).items()}
        return cls(signals, parameters, data.get("origin", ""), data.get("rationale", ""))
