"""What signals were each time that a discrete signal changed, which tells of thresholds and conditions."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.numbers import column_decimals, plain
from falsifier.llm.prompts.view import View

# Changes that are told, and the conditions of one.
_MOST_TOLD, _MOST_CONDITIONS = 6, 4
# A condition is a range that is so narrow, as a share of all values, in which a signal is for no more than
# this share of the time, and in which it would be each time by chance with no more than this probability.
_NARROW, _SELDOM, _CHANCE = 0.1, 0.6, 0.03
# A signal with so many different changes counts: all that lead up are told together, and all that lead down.
_COUNTS = 7
_UP, _DOWN = (-inf, inf), (inf, -inf)  # its further changes
# Times of a sample that are looked at for the values that signals have.
_TIMES = 100

_HEAD = "So far, other signals just before each change of a discrete signal, and inputs at the change, were:"


# How often a signal changed, and the least and the greatest value of each signal then, shape (signals,).
Seen = tuple[int, Array, Array]


@dataclass
class Regularities:
    """Collects what was so when discrete signals changed."""

    view: View
    _known: list[Array] = field(default_factory=list)  # values of a sample, shape (signals, times)
    # By signal and by its values before and after, what was seen in each sample.
    _seen: defaultdict[str, defaultdict[tuple[float, float], list[Seen]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(list))
    )

    def add(self, trajectory: Trajectory) -> None:
        """Add a sample."""
        inside = self.view.inside(trajectory)
        if not inside.columns.keys() >= set(self._names):
            return
        then = np.stack([inside[name] for name in self._names])
        before = np.roll(then, 1, axis=1)
        before[len(self.view.recorded) :] = then[len(self.view.recorded) :]
        self._known.append(then[:, :: max(1, len(inside) // _TIMES)])
        for name, column in self.view.discrete(inside).items():
            seen, at = self._seen[name], defaultdict[tuple[float, float], list[int]](list)
            for k in (np.flatnonzero(np.diff(column)) + 1).tolist():
                change = float(column[k - 1]), float(column[k])
                if change not in seen and len(seen.keys() | at.keys()) >= _COUNTS:
                    change = _UP if change[1] > change[0] else _DOWN
                at[change].append(k)
            for change, found in at.items():
                values = before[:, found]
                seen[change].append((len(found), values.min(axis=1), values.max(axis=1)))

    @property
    def text(self) -> str:
        """What was so each time, in a line for each change, those of the requirement's signals first."""
        lines = [line for name in self.view.recorded if name in self._seen for line in self._of(name)]
        return "\n".join((_HEAD, *lines[:_MOST_TOLD])) if lines else ""

    @cached_property
    def _names(self) -> tuple[str, ...]:
        """Signals that are told, then inputs."""
        recorded = self.view.recorded
        return (*recorded, *(r.name for r in self.view.space.inputs if r.name not in recorded))

    def _of(self, name: str) -> Iterator[str]:
        changes: defaultdict[str, list[Seen]] = defaultdict(list)
        for (a, b), seen in self._seen[name].items():
            way = "up" if b > a else "down"
            one = f"{self._value(name, a, 6)} -> {self._value(name, b, 6)}"
            changes[way if len(self._seen[name]) >= _COUNTS else one] += seen
        for change, seen in changes.items():
            if so := self._common(name, seen):
                count = sum(times for times, _, _ in seen)
                yield f"- {name} {change}, {count} times: {', '.join(so[:_MOST_CONDITIONS])}"

    def _common(self, changed: str, seen: Sequence[Seen]) -> list[str]:
        """Signals that were in a narrow range each time, and seldom are, the most telling ones first."""
        known = np.concatenate(self._known, axis=1)
        counts, lows, highs = zip(*seen, strict=True)
        low, high = np.min(lows, axis=0), np.max(highs, axis=0)
        share = ((known >= low[:, None]) & (known <= high[:, None])).mean(axis=1)
        is_narrow = (high - low <= _NARROW * np.ptp(known, axis=1)) & (share <= _SELDOM)
        # The first time says where the range is.
        is_condition = is_narrow & (share ** (sum(counts) - 1) <= _CHANCE)
        words = []
        for k in [k for k in np.argsort(share).tolist() if is_condition[k] and self._names[k] != changed]:
            ends = (self._value(self._names[k], end, column_decimals(known[k])) for end in (low[k], high[k]))
            words.append(f"{self._names[k]} {' to '.join(dict.fromkeys(ends))}")
        return words

    def _value(self, name: str, value: float, decimals: int) -> str:
        return self.view.labelled(name, value, plain(value, decimals))
