"""Which values of what is chosen the samples have tried; told where the robustness gives no direction."""

from dataclasses import dataclass, field

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Range
from falsifier.core.words import listed
from falsifier.llm.prompts.numbers import bounds
from falsifier.llm.prompts.view import View

# Share of a range that is told if no sample had a value in it.
_WIDE = 0.3
# Values of an interpolated input that count as tried, values that are listed, digits of the others.
_VALUES, _MOST_LISTED, _DIGITS = 100, 6, 2
# More different ranges, most of which do not matter, are not told.
_MOST_GAPS = 4


@dataclass(slots=True)
class Tried:
    """The values that samples had so far, by the name of the input or parameter."""

    view: View
    _values: dict[str, set[float]] = field(default_factory=dict)

    def add(self, candidate: Candidate) -> None:
        """Add a sample."""
        for name, signal in candidate.signals.items():
            values = signal.values
            if signal.interpolation != "constant":  # it passes through all between the least and the greatest
                values = np.linspace(min(values), max(values), _VALUES).tolist()
            self._values.setdefault(name, set()).update(values)
        for name, value in candidate.parameters.items():
            self._values.setdefault(name, set()).add(value)

    @property
    def gaps(self) -> str:
        """What no sample tried; empty if they tried about all, or left out too many different ranges."""
        alike: dict[str, list[str]] = {}
        for r in self.view.space.ranges:
            if gap := self._gap(r):
                alike.setdefault(gap, []).append(r.name)
        told = (f"{listed(names)} {gap}" for gap, names in alike.items())
        return "; ".join(told) if len(alike) <= _MOST_GAPS else ""

    def _gap(self, r: Range) -> str:
        tried = sorted(self._values.get(r.name, ()))
        if r.kind != "real" and r.high - r.low < _VALUES:
            left = [str(n) for n in r.numbers if n not in tried]
            few = ", ".join((*left[:_MOST_LISTED], *(["..."] if len(left) > _MOST_LISTED else [])))
            return f"= {few}" if left else ""
        edges = [r.low, *tried, r.high]
        gaps = np.diff(r.share_of(np.array(edges)))
        told = []
        for k in np.flatnonzero(gaps > _WIDE).tolist():
            low, high = bounds(edges[k], edges[k + 1], _DIGITS)
            if edges[k] not in tried:
                told.append(f"from {low} to below {high}")
            elif edges[k + 1] not in tried:
                told.append(f"above {low} up to {high}")
            else:
                told.append(f"between {low} and {high}")
        return ", ".join(told)
