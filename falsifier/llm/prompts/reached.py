"""How far the recorded signals of a sample got, which says more than a robustness that is flat."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from math import fsum

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.core.words import resolving
from falsifier.llm.prompts.numbers import column_decimals, number, plain
from falsifier.llm.prompts.view import View

# A value or a change of a discrete signal: its name, the value before, the value.
Stage = tuple[str, float | None, float]

# A signal went further if it left the range seen so far by more than this share of it.
_FURTHER = 0.1
# Changes of a signal that chatters are not listed, nor more than so many things that are new.
_MOST_NEW = 8
# Times of first changes that are told, and signals that are told at each.
_MOST_SWITCHES, _MOST_BESIDE = 6, 6


@dataclass(frozen=True, slots=True)
class SampleProgress:
    """What the recorded signals of one sample did: stages of the discrete ones, ranges of the others."""

    stages: frozenset[Stage] = frozenset()
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # Changes by the index at which each came first, unless another signal repeated one of its changes there.
    changes: Mapping[int, tuple[Stage, ...]] = field(default_factory=dict)

    @classmethod
    def of(cls, view: View, trajectory: Trajectory) -> "SampleProgress":
        """Look at a trajectory up to where the requirement looks."""
        columns = view.inside(trajectory).columns
        stages: set[Stage] = set()
        changes: dict[int, tuple[Stage, ...]] = {}
        repeated: set[int] = set()
        ranges = {}
        for name in (name for name in view.recorded if name in columns):
            column = columns[name]
            if view.is_discrete(name, column):
                begun = np.flatnonzero(np.diff(column, prepend=np.nan)).tolist()
                stages |= {(name, None, value) for value in column[begun].tolist()}
                for before, k in pairwise(begun):
                    change = (name, float(column[before]), float(column[k]))
                    if change in stages:
                        repeated.add(k)
                    stages.add(change)
                    changes[k] = (*changes.get(k, ()), change)
            elif np.isfinite(column).all():
                ranges[name] = (float(column.min()), float(column.max()))
        firsts = {k: changes[k] for k in sorted(changes) if k not in repeated}
        return cls(frozenset(stages), ranges, firsts)


class Reached:
    """What the samples of a run have reached so far."""

    def __init__(self, view: View) -> None:
        self._view = view
        self._stages: Counter[Stage] = Counter()  # in how many samples
        self._ranges: dict[str, tuple[float, float]] = {}

    def news(self, progress: SampleProgress) -> tuple[str, ...]:
        """Add a sample; return what no earlier one did, in words; of the first one nothing."""
        is_begun = self._stages or self._ranges
        found = [*self._new_stages(progress), *self._further(progress)] if is_begun else []
        self._stages.update(progress.stages)
        for name, (low, high) in progress.ranges.items():
            least, most = self._ranges.get(name, (low, high))
            self._ranges[name] = (min(low, least), max(high, most))
        return (*found[:_MOST_NEW], *(["..."] if len(found) > _MOST_NEW else []))

    def switches(self, progress: SampleProgress, trajectory: Trajectory, clock: int) -> str:
        """When discrete signals made changes that no earlier sample made, and the other signals at that time.

        It is to be called before the sample is added; ``clock`` is the number of decimals of times.
        """
        told = []
        for k, changes in progress.changes.items() if progress.ranges else ():
            if not self._stages.keys() & set(changes):
                columns = {name: trajectory[name] for name in list(progress.ranges)[:_MOST_BESIDE]}
                beside = (f"{n} {plain(float(c[k]), column_decimals(c))}" for n, c in columns.items())
                time = f"at {plain(trajectory.times[k], clock)} s"
                told.append(f"{', '.join(map(self._stage, changes))} {time} ({', '.join(beside)})")
        return "; ".join((*told[:_MOST_SWITCHES], *(["..."] if len(told) > _MOST_SWITCHES else [])))

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

    def _new_stages(self, progress: SampleProgress) -> Iterator[str]:
        new = progress.stages - self._stages.keys()
        yield from map(self._stage, sorted(new, key=lambda s: (s[0], s[1] is not None, s[1] or 0.0, s[2])))

    def _stage(self, stage: Stage) -> str:
        name, before, value = stage
        text = self._value(name, value)
        return f"{name} {text}" if before is None else f"{name} {self._value(name, before)} -> {text}"

    def _value(self, name: str, value: float) -> str:
        return self._view.labelled(name, value, plain(value, 6))

    def _further(self, progress: SampleProgress) -> Iterator[str]:
        for name, (low, high) in progress.ranges.items():
            least, most = self._ranges.get(name, (low, high))
            least_new = _FURTHER * (most - least)
            if high > most + least_new:
                yield f"{name} above {number(most, resolving(most, high - most, 3))}"
            if low < least - least_new:
                yield f"{name} below {number(least, resolving(least, least - low, 3))}"
