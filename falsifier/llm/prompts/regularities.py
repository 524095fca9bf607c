"""What signals were each time that a discrete signal changed, which tells of thresholds and conditions."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.llm.prompts.courses import Array, jumps
from falsifier.llm.prompts.numbers import column_decimals, value_text
from falsifier.llm.prompts.view import View

# Changes that are told, and the conditions of one; recorded signals and inputs that are looked at.
_MOST_TOLD, _MOST_CONDITIONS, _MOST_RECORDED, _MOST_INPUTS = 6, 4, 24, 12
# A condition is a range, or two, as narrow as this share of all values, in which a signal is for no more than
# this share of the time, and in which some signal would be each time by chance with no more than this
# probability.
_NARROW, _SELDOM, _CHANCE = 0.1, 0.6, 0.1
# A signal with so many different changes counts: all that lead up are told together, and all that lead down.
_COUNTS = 7
# A signal that changes more often in a sample chatters, and nothing is told of it.
_CHATTERS = 200
# Times of a sample that are looked at for the values that signals have.
_TIMES = 100

_JUMPS = "jumps"  # what a signal that is not discrete does
_HEAD = (
    "So far, signals just before each change of a discrete signal, or jump of another one, and inputs at "
    "that time, were as follows; what samples with the same beginning share counts once:"
)


@dataclass
class Regularities:
    """Collects what was so when discrete signals changed, and others jumped."""

    view: View
    _known: list[Array] = field(default_factory=list)  # values of a sample, shape (signals, times)
    # By signal and its change, in words and whether it leads up, the values of all signals, then the time.
    _seen: defaultdict[str, defaultdict[tuple[str, bool], list[Array]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(list))
    )
    _chattering: set[str] = field(default_factory=set)

    def add(self, trajectory: Trajectory) -> None:
        """Add a sample."""
        inside = self.view.inside(trajectory)
        if not inside.columns.keys() >= set(self._names):
            return
        then = np.stack([inside[name] for name in self._names])
        before = np.roll(then, 1, axis=1)
        before[len(self._recorded) :] = then[len(self._recorded) :]
        self._known.append(then[:, :: max(1, len(inside) // _TIMES)])
        discrete = self.view.discrete(inside)
        for name in self._recorded:
            column = inside[name]
            changes = np.flatnonzero(np.diff(column)) + 1 if name in discrete else jumps(column)
            if len(changes) > _CHATTERS:
                self._chattering.add(name)
            for k in changes[:_CHATTERS].tolist():
                is_up = bool(column[k] > column[k - 1])
                ends = (value_text(self.view, name, v) for v in column[k - 1 : k + 1].tolist())
                change = " -> ".join(ends) if name in discrete else _JUMPS
                self._seen[name][change, is_up].append(np.append(before[:, k], inside.times[k]))

    @property
    def text(self) -> str:
        """What was so each time, in a line for each change, those of the requirement's signals first."""
        names = (n for n in self._recorded if n in self._seen and n not in self._chattering)
        lines = [line for name in names for line in self._of(name)]
        lines.sort(key=lambda line: f" {_JUMPS} " in line)
        return "\n".join((_HEAD, *lines[:_MOST_TOLD])) if lines else ""

    @cached_property
    def _recorded(self) -> tuple[str, ...]:
        return self.view.recorded[:_MOST_RECORDED]

    @cached_property
    def _names(self) -> tuple[str, ...]:
        """Signals that are told, then inputs."""
        inputs = [r.name for r in self.view.space.inputs if r.name not in self._recorded]
        return (*self._recorded, *inputs[:_MOST_INPUTS])

    def _of(self, name: str) -> Iterator[str]:
        counts = len(self._seen[name]) >= _COUNTS
        # It may have looked discrete in other samples.
        is_real = any(change == _JUMPS for change, _ in self._seen[name])
        changes: defaultdict[str, list[Array]] = defaultdict(list)
        for (change, is_up), found in self._seen[name].items():
            way = f"{f'{_JUMPS} ' * is_real}{'up' if is_up else 'down'}"
            changes[way if is_real or counts else change] += found
        for change, found in changes.items():
            # Samples with the same beginning have the same changes there, which are one.
            seen: Array = np.unique(np.array(found), axis=0)[:, :-1]
            if so := self._common(seen.T, without="" if is_real else name):
                yield f"- {name} {change}, {len(seen)} times: {', '.join(so[:_MOST_CONDITIONS])}"

    def _common(self, seen: Array, *, without: str) -> list[str]:
        """Signals that were in a narrow range each time, and seldom are, the most telling ones first.

        ``seen`` has their values, shape (signals, times).
        """
        found = []
        for name, values, known in zip(self._names, seen, np.concatenate(self._known, axis=1), strict=True):
            ranges = [] if name == without else _ranges(values, float(np.ptp(known)))
            share = float(sum(((known >= low) & (known <= high)).mean() for low, high in ranges))
            # The first time in each range says where it is.
            by_chance = len(self._names) * share ** (len(values) - len(ranges))
            if ranges and share <= _SELDOM and by_chance <= _CHANCE:
                digits = column_decimals(known)
                ends = (dict.fromkeys(value_text(self.view, name, v, digits) for v in one) for one in ranges)
                found.append((share, f"{name} {' or '.join(map(' to '.join, ends))}"))
        return [text for _, text in sorted(found)]


def _ranges(values: Array, span: float) -> list[tuple[float, float]]:
    """The narrow range in which values are, as those of a threshold; or two, as those of two; else none."""
    ordered = np.sort(values)
    parts = [ordered]
    if np.ptp(ordered) > _NARROW * span:
        parts = np.split(ordered, [int(np.diff(ordered).argmax()) + 1])
    is_narrow = sum(map(np.ptp, parts)) <= _NARROW * span and min(map(len, parts)) >= len(parts)
    return [(float(part[0]), float(part[-1])) for part in parts] if is_narrow else []
