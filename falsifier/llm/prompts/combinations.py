"""Which values of discrete signals were never there at the same time; told where robustness says little."""

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.llm.prompts.numbers import plain
from falsifier.llm.prompts.view import View

# Values of a signal that is looked at, signals, and combinations that are told.
_MOST_VALUES, _MOST_SIGNALS, _MOST_TOLD = 6, 12, 8


@dataclass(slots=True)
class Combinations:
    """Collects the values that discrete signals and inputs had together."""

    view: View
    _times: defaultdict[str, Counter[float]] = field(default_factory=lambda: defaultdict(Counter))
    _seen: defaultdict[tuple[str, str], set[tuple[float, float]]] = field(
        default_factory=lambda: defaultdict(set)
    )

    def add(self, trajectory: Trajectory) -> None:
        """Add a sample."""
        inside = self.view.inside(trajectory)
        inputs = [r.name for r in self.view.space.inputs if r.kind != "real" and r.name in inside.columns]
        names = [*list(self.view.discrete(inside))[:_MOST_SIGNALS], *inputs[:_MOST_SIGNALS]]
        for name in names:
            values, counts = np.unique(inside[name], return_counts=True)
            self._times[name].update(dict(zip(values.tolist(), counts.tolist(), strict=True)))
        for one, two in combinations(dict.fromkeys(names), 2):
            pairs = np.unique(np.stack((inside[one], inside[two])), axis=1)
            self._seen[one, two].update(map(tuple, pairs.T.tolist()))

    @property
    def text(self) -> str:
        """Those that would have been there the most often if signals had nothing to do with each other."""
        found = sorted(self._never(), reverse=True)[:_MOST_TOLD]
        return f"Never at one time so far: {'; '.join(text for _, text in found)}." if found else ""

    def _never(self) -> Iterator[tuple[float, str]]:
        searched = self.view.space.names
        few = {name: times for name, times in self._times.items() if 1 < len(times) <= _MOST_VALUES}
        for (one, two), seen in self._seen.items():
            if not (one in few and two in few) or (one in searched and two in searched):
                continue
            for a, b in product(few[one], few[two]):
                if (a, b) not in seen:
                    expected = few[one][a] * few[two][b] / few[two].total()
                    yield expected, f"{self._value(one, a)} with {self._value(two, b)}"

    def _value(self, name: str, value: float) -> str:
        return f"{name} {self.view.labelled(name, value, plain(value, 6))}"
