"""How far the recorded signals of a sample got, which says more than a robustness that is flat."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import fsum, inf
from typing import TypeVar

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.core.words import resolving
from falsifier.llm.prompts.numbers import column_decimals, number, plain
from falsifier.llm.prompts.view import View

# A value or a change of a discrete signal: its name, the value before, the value.
Stage = tuple[str, float | None, float]

T = TypeVar("T")

# A signal went further if it left the range seen so far by more than this share of it.
_FURTHER = 0.05
# New things that are told, of these those of one signal, and times of new changes.
_MOST_NEW, _MOST_OF_ONE, _MOST_SWITCHES = 8, 3, 8
# Outputs and inputs that are told at each new change.
_MOST_BESIDE = 6


@dataclass(frozen=True, slots=True)
class SampleProgress:
    """What the recorded signals of one sample did: stages of the discrete ones, ranges of the others."""

    stages: frozenset[Stage] = frozenset()
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # Changes by the index at which each came first; of signals of the requirement, also again.
    changes: Mapping[int, tuple[Stage, ...]] = field(default_factory=dict)

    @classmethod
    def of(cls, view: View, trajectory: Trajectory) -> "SampleProgress":
        """Look at a trajectory up to where the requirement looks."""
        columns = view.inside(trajectory).columns
        stages: set[Stage] = set()
        changes: dict[int, tuple[Stage, ...]] = {}
        ranges = {}
        for name in (name for name in view.recorded if name in columns):
            column = columns[name]
            if view.is_discrete(name, column):
                begun = np.flatnonzero(np.diff(column, prepend=np.nan)).tolist()
                stages |= {(name, None, value) for value in column[begun].tolist()}
                told = _ends(begun[1:]) if name in view.formula_outputs else ()
                for before, k in pairwise(begun):
                    change = (name, float(column[before]), float(column[k]))
                    if change not in stages or k in told:
                        stages.add(change)
                        changes[k] = (*changes.get(k, ()), change)
            elif np.isfinite(column).all():
                ranges[name] = (float(column.min()), float(column.max()))
        return cls(frozenset(stages), ranges, dict(sorted(changes.items())))


class Reached:
    """What the samples of a run have reached so far."""

    def __init__(self, view: View) -> None:
        self._view = view
        self._stages: Counter[Stage] = Counter()  # in how many samples
        self._ranges: dict[str, tuple[float, float]] = {}

    def news(self, progress: SampleProgress) -> tuple[str, ...]:
        """Add a sample; return the values that no earlier one reached, in words; of the first one nothing."""
        values = sorted(
            (name, value)
            for name, before, value in progress.stages - self._stages.keys()
            if before is None and not self._passed(name, value)
        )
        is_begun = self._stages or self._ranges
        new = self._few([(name, None, value) for name, value in values])
        found = [*map(self._stage, new), *self._further(progress)] if is_begun else []
        self._stages.update(progress.stages)
        for name, (low, high) in progress.ranges.items():
            least, most = self._ranges.get(name, (low, high))
            self._ranges[name] = (min(low, least), max(high, most))
        return (*found[:_MOST_NEW], *(["..."] if len(found) > _MOST_NEW else []))

    def is_new(self, progress: SampleProgress) -> bool:
        """Whether a discrete signal made a change that it made in no earlier sample."""
        return any(c not in self._stages for changes in progress.changes.values() for c in changes)

    def switches(self, progress: SampleProgress, trajectory: Trajectory, clock: int) -> str:
        """When discrete signals made changes that no earlier sample made, and all else of that time.

        Those of the requirement also where earlier samples made the same. It is to be called before the
        sample is added; ``clock`` is the number of decimals of times.
        """
        judged = self._view.formula_outputs
        new = {
            k: [c for c in changes if c not in self._stages or c[0] in judged]
            for k, changes in progress.changes.items()
        }
        few = self._few([change for changes in new.values() for change in changes])
        discrete = {name for name, _, _ in progress.stages}
        inputs = [r.name for r in self._view.space.inputs if r.name in trajectory.columns]
        names = [*list(progress.ranges)[:_MOST_BESIDE], *(inputs if len(inputs) <= _MOST_BESIDE else ())]
        columns = {name: trajectory[name] for name in names}
        told = []
        for k, changes in new.items():
            if any(change in few for change in changes):
                beside = (
                    f"{n} {self._view.labelled(n, float(c[k]), plain(float(c[k]), column_decimals(c)))}"
                    for n, c in columns.items()
                )
                time = f"at {plain(trajectory.times[k], clock)} s"
                together = (
                    self._stage((name, float(trajectory[name][k - 1]), float(trajectory[name][k])))
                    for name in self._view.recorded
                    if name in discrete and trajectory[name][k - 1] != trajectory[name][k]
                )
                told.append(f"{', '.join(together)} {time}" + (f" ({', '.join(beside)})" if columns else ""))
        is_all = len(told) == sum(map(bool, new.values())) <= _MOST_SWITCHES
        return "; ".join((*told[:_MOST_SWITCHES], *([] if is_all else ["..."])))

    @property
    def unmoved(self) -> str:
        """Which signals were the same in all samples; empty if none was."""
        moved = {name for name, before, _ in self._stages if before is not None}
        moved |= {name for name, (low, high) in self._ranges.items() if low < high}
        values = Counter(name for name, before, _ in self._stages if before is None)
        known = [n for n in self._view.recorded if n in values or n in self._ranges]
        same = [name for name in known if name not in moved and values[name] < 2]
        return f"The same in all samples: {', '.join(same)}." if same else ""

    @staticmethod
    def _few(stages: Sequence[Stage]) -> list[Stage]:
        """Of each signal its first stages and its last one: of a counter, not all."""
        by_name: dict[str, list[Stage]] = {}
        for stage in stages:
            by_name.setdefault(stage[0], []).append(stage)
        return [stage for found in by_name.values() for stage in _ends(found)]

    def rank(self, progress: SampleProgress) -> tuple[float, float]:
        """How far a sample got: its stages, of which rare ones count more; then the share of all ranges."""
        shares = [
            (high - low) / (most - least)
            for name, (low, high) in progress.ranges.items()
            for least, most in [self._ranges.get(name, (low, high))]
            if most > least
        ]
        rarity = fsum(1.0 / self._stages[stage] for stage in progress.stages)
        return rarity, sum(shares) / len(shares) if shares else 0.0

    def _stage(self, stage: Stage) -> str:
        name, before, value = stage
        text = self._value(name, value)
        return f"{name} {text}" if before is None else f"{name} {self._value(name, before)} -> {text}"

    def _value(self, name: str, value: float) -> str:
        return self._view.labelled(name, value, plain(value, 6))

    def _passed(self, name: str, value: float) -> bool:
        """Whether a signal that was not discrete in an earlier sample had this value there."""
        least, most = self._ranges.get(name, (inf, -inf))
        return least <= value <= most

    def _further(self, progress: SampleProgress) -> Iterator[str]:
        for name, (low, high) in progress.ranges.items():
            known = [value for n, before, value in self._stages if n == name and before is None]
            known += self._ranges.get(name, () if known else (low, high))
            least, most = min(known), max(known)
            least_new = _FURTHER * (most - least)
            if high > most + least_new:
                digits = resolving(most, high - most, 3)
                yield f"{name} up to {number(high, digits)}, before {number(most, digits)}"
            if low < least - least_new:
                digits = resolving(least, least - low, 3)
                yield f"{name} down to {number(low, digits)}, before {number(least, digits)}"


def _ends(found: Sequence[T]) -> Sequence[T]:
    """The first ones and the last one."""
    return [*found[: _MOST_OF_ONE - 1], *found[_MOST_OF_ONE - 1 :][-1:]]
