"""What signals were each time that a discrete signal changed, which tells of thresholds and conditions."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain

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
    # By signal and its change, in words and whether it leads up, the values of all signals, then the time, as
    # bytes: samples with the same beginning have the same changes there, which are one.
    _seen: defaultdict[str, defaultdict[tuple[str, bool], dict[bytes, None]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(dict))
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
        rows = np.vstack((before, inside.times)).T + 0.0  # there are two zeros, with other bytes
        discrete = self.view.discrete(inside)
        for name in self._recorded:
            column = inside[name]
            changes = np.flatnonzero(np.diff(column)) + 1 if name in discrete else jumps(column)
            if len(changes) > _CHATTERS:
                self._chattering.add(name)
            if name in self._chattering:
                continue
            pairs = list(zip(column[changes - 1].tolist(), column[changes].tolist(), strict=True))
            ends = {v: value_text(self.view, name, v) for v in {*chain(*pairs)} if name in discrete}
            for (old, new), row in zip(pairs, rows[changes], strict=True):
                change = f"{ends[old]} -> {ends[new]}" if ends else _JUMPS
                self._seen[name][change, new > old][row.tobytes()] = None

    @property
    def text(self) -> str:
        """What was so each time, in a line for each change, those of the requirement's signals first."""
        names = (n for n in self._recorded if n in self._seen and n not in self._chattering)
        known = np.concatenate(self._known, axis=1) if self._known else np.empty(0)
        lines = [line for name in names for line in self._of(name, known)]
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

    def _of(self, name: str, known: Array) -> Iterator[str]:
        counts = len(self._seen[name]) >= _COUNTS
        # It may have looked discrete in other samples.
        is_real = any(change == _JUMPS for change, _ in self._seen[name])
        changes: defaultdict[str, dict[bytes, None]] = defaultdict(dict)
        for (change, is_up), found in self._seen[name].items():
            way = f"{f'{_JUMPS} ' * is_real}{'up' if is_up else 'down'}"
            changes[way if is_real or counts else change] |= found
        for change, found in changes.items():
            seen = np.frombuffer(b"".join(found)).reshape(len(found), -1)[:, :-1]
            if so := self._common(seen.T, known, without="" if is_real else name):
                yield f"- {name} {change}, {len(seen)} times: {', '.join(so[:_MOST_CONDITIONS])}"

    def _common(self, seen: Array, known: Array, *, without: str) -> list[str]:
        """Signals that were in a narrow range each time, and seldom are, the most telling ones first.

        ``seen`` has their values then, ``known`` those at all times, shape (signals, times) each.
        """
        found = []
        for name, values, usual in zip(self._names, seen, known, strict=True):
            ranges = [] if name == without else _ranges(values, float(np.ptp(usual)))
            share = float(sum(((usual >= low) & (usual <= high)).mean() for low, high in ranges))
            # The first time in each range says where it is.
            by_chance = len(self._names) * share ** (len(values) - len(ranges))
            if ranges and share <= _SELDOM and by_chance <= _CHANCE:
                digits = column_decimals(usual)
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
