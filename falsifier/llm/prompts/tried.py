"""Which values of what is chosen the samples have tried, and which differences had no effect."""

from collections import defaultdict
from dataclasses import dataclass, field
from hashlib import sha256

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Range
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import first_few, listed
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
    # Numbers of the samples with the same recorded signals, and what was chosen for them by name.
    _same: defaultdict[bytes, tuple[list[int], defaultdict[str, set[object]]]] = field(
        default_factory=lambda: defaultdict(lambda: ([], defaultdict(set)))
    )

    def add(self, candidate: Candidate) -> None:
        """Add a sample."""
        for name, signal in candidate.signals.items():
            values = signal.values
            if signal.interpolation != "constant":  # it passes through all between the least and the greatest
                values = np.linspace(min(values), max(values), _VALUES).tolist()
            self._values.setdefault(name, set()).update(values)
        for name, value in candidate.parameters.items():
            self._values.setdefault(name, set()).add(value)

    def observe(self, number: int, candidate: Candidate, trajectory: Trajectory) -> None:
        """Add what came of a sample."""
        columns = self.view.inside(trajectory).columns
        recorded = [columns[name] + 0.0 for name in self.view.recorded if name in columns]
        numbers, chosen = self._same[sha256(np.array(recorded).tobytes()).digest()]
        numbers.append(number)
        for name in candidate.signals.keys() & columns.keys():
            chosen[name].add(sha256((columns[name] + 0.0).tobytes()).digest())
        for name, value in candidate.parameters.items():
            chosen[name].add(value)

    @property
    def idle(self) -> str:
        """In what most samples with the same recorded signals differ; empty if there are no two that do."""
        found = []
        for numbers, chosen in self._same.values():
            if differing := [name for name in self.view.space.names if len(chosen[name]) > 1]:
                found.append((-len(numbers), numbers, differing))
        if not found:
            return ""
        _, numbers, differing = min(found)
        which = f"{len(numbers)} samples, the first of them sample {numbers[0]},"
        if len(numbers) <= _MOST_LISTED:
            which = f"Samples {listed([*map(str, numbers)])}"
        return f"{which} differ in {first_few(differing, _MOST_LISTED)}, and in no recorded signal."

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
