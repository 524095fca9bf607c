"""Which values of discrete signals were never there at the same time; told where robustness says little."""

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.llm.prompts.numbers import value_text
from falsifier.llm.prompts.view import View

# Values of a signal that is looked at, of an input, signals, and values whose missing companions are told.
_MOST_VALUES, _MOST_OF_INPUTS, _MOST_SIGNALS, _MOST_TOLD = 6, 12, 12, 8


@dataclass(slots=True)
class Combinations:
    """Collects the values that discrete signals and inputs had together; drops what proves to be neither."""

    view: View
    _left: list[str] | None = None  # None: no sample was seen
    _times: defaultdict[str, Counter[float]] = field(default_factory=lambda: defaultdict(Counter))
    _seen: defaultdict[tuple[str, str], set[tuple[float, float]]] = field(
        default_factory=lambda: defaultdict(set)
    )

    def add(self, trajectory: Trajectory) -> None:
        """Add a sample."""
        inside = self.view.inside(trajectory)
        names = self._possible(inside) if self._left is None else self._left
        columns = {name: inside[name] for name in names if name in inside.columns}
        for name, column in columns.items():
            values, counts = np.unique(column, return_counts=True)
            self._times[name].update(dict(zip(values.tolist(), counts.tolist(), strict=True)))
        self._left = [n for n in columns if self._has_few_whole_values(n)]
        if self._left:
            rows = np.stack([columns[n] for n in self._left])
            begun = np.append(True, (np.diff(rows, axis=1) != 0).any(axis=0))
            states = np.unique(rows[:, begun], axis=1).tolist()
            for (one, these), (two, those) in combinations(zip(self._left, states, strict=True), 2):
                self._seen[one, two].update(zip(these, those, strict=True))

    def _possible(self, inside: Trajectory) -> list[str]:
        """Those that are discrete, or may prove so as they have not moved yet."""
        discrete = self.view.discrete(inside)
        still = [n for n in self.view.recorded if n in inside.columns and np.ptp(inside[n]) == 0]
        inputs = [r.name for r in self.view.space.inputs if r.kind != "real"]
        return [*list(dict.fromkeys((*discrete, *still)))[:_MOST_SIGNALS], *inputs[:_MOST_SIGNALS]]

    @property
    def text(self) -> str:
        """Those with inputs, which can be tried, then others; the likeliest ones first.

        That is, if signals had nothing to do with each other.
        """
        found = sorted(self._never(), reverse=True)[:_MOST_TOLD]
        return f"Never at one time so far: {'; '.join(text for *_, text in found)}." if found else ""

    def _never(self) -> Iterator[tuple[bool, float, str]]:
        searched, few = self.view.space.names, self._times
        for one, two in combinations(self._left or (), 2):
            if one in searched and two in searched:
                continue
            seen, all_times = self._seen[one, two], few[two].total()
            for a in few[one]:
                if others := [b for b in sorted(few[two]) if (a, b) not in seen]:
                    expected = few[one][a] * sum(few[two][b] for b in others) / all_times
                    told = ", ".join(value_text(self.view, two, b) for b in others)
                    text = f"{one} {value_text(self.view, one, a)} with {two} {told}"
                    yield two in searched, expected, text

    def _has_few_whole_values(self, name: str) -> bool:
        values = self._times[name]
        most = _MOST_OF_INPUTS if name in self.view.space.names else _MOST_VALUES
        return len(values) <= most and all(value.is_integer() for value in values)
