"""How far the recorded signals of a sample got, which says more than a robustness that is flat."""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import fsum, inf
from operator import itemgetter

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.core.words import resolving
from falsifier.llm.prompts.courses import jumps
from falsifier.llm.prompts.numbers import column_decimals, fine_clock, number, plain, value_text
from falsifier.llm.prompts.view import View

# A value or a change of a discrete signal: its name, the value before, the value.
Stage = tuple[str, float | None, float]

# A signal went further if it left the range seen so far by more than this share of it.
_FURTHER = 0.05
# New things that are told, of these those of one signal, and times of changes.
_MOST_NEW, _MOST_OF_ONE, _MOST_SWITCHES = 8, 3, 8
# New changes of a signal of the requirement up to which it is a mode, and no counter; changes of others up to
# which all of them are told again.
_MOST_OF_MODE = 6
# Outputs and inputs that are told at each new change, of more inputs those that jump there; ranges told.
_MOST_BESIDE = 6


@dataclass(frozen=True, slots=True)
class SampleProgress:
    """What the recorded signals of one sample did: stages of the discrete ones, ranges of the others."""

    stages: frozenset[Stage] = frozenset()
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # Changes by the index at which each came first; where signals of the requirement, and those that seldom
    # change, did so.
    changes: Mapping[int, tuple[Stage, ...]] = field(default_factory=dict)
    again: frozenset[int] = frozenset()

    @classmethod
    def of(cls, view: View, trajectory: Trajectory) -> "SampleProgress":
        """Look at a trajectory up to where the requirement looks."""
        columns = view.inside(trajectory).columns
        stages: set[Stage] = set()
        changes: dict[int, tuple[Stage, ...]] = {}
        again: set[int] = set()
        ranges = {}
        for name in (name for name in view.recorded if name in columns):
            column = columns[name]
            if view.is_discrete(name, column):
                begun = np.flatnonzero(np.diff(column, prepend=np.nan)).tolist()
                stages |= {(name, None, value) for value in column[begun].tolist()}
                first: dict[Stage, int] = {}  # where each change came first
                for before, k in pairwise(begun):
                    first.setdefault((name, float(column[before]), float(column[k])), k)
                stages |= first.keys()
                for change, k in first.items():
                    changes[k] = (*changes.get(k, ()), change)
                is_mode = name in view.formula_outputs and len(first) <= _MOST_OF_MODE
                if is_mode or len(begun) <= _MOST_OF_MODE:
                    again.update(begun[1 : _MOST_SWITCHES + 2])
            elif np.isfinite(column).all():
                ranges[name] = (float(column.min()), float(column.max()))
        return cls(frozenset(stages), ranges, dict(sorted(changes.items())), frozenset(again))


class Reached:
    """What the samples of a run have reached so far."""

    def __init__(self, view: View) -> None:
        self._view = view
        self._stages: Counter[Stage] = Counter()  # in how many samples
        self._ranges: dict[str, tuple[float, float]] = {}

    def news(self, progress: SampleProgress) -> tuple[str, ...]:
        """Add a sample; return the values that no earlier one reached, in words; of the first one nothing."""
        values = (s for s in progress.stages - self._stages.keys() if s[1] is None and not self._passed(s))
        new = self._few(sorted(values, key=itemgetter(0, 2)))
        is_begun = self._stages or self._ranges
        found = [*map(self._stage, new), *self._further(progress)] if is_begun else []
        self._stages.update(progress.stages)
        for name, (low, high) in progress.ranges.items():
            least, most = self._ranges.get(name, (low, high))
            self._ranges[name] = (min(low, least), max(high, most))
        return (*found[:_MOST_NEW], *(["..."] if len(found) > _MOST_NEW else []))

    def new_changes(self, progress: SampleProgress) -> list[Stage]:
        """Changes of discrete signals that no earlier sample made."""
        return [c for found in progress.changes.values() for c in found if c not in self._stages]

    def switches(self, progress: SampleProgress, trajectory: Trajectory) -> str:
        """When discrete signals changed, and other signals at that time.

        Told are changes that no earlier sample made, those of the requirement's signals before others; then
        others of the requirement's signals, and of those that seldom change. It is to be called before the
        sample is added.
        """
        judged, new = self._view.formula_outputs, self.new_changes(progress)
        few = self._few(new, but_all_of=judged)

        def urgency(k: int) -> tuple[int, int]:
            found = progress.changes.get(k, ())
            told = [c[0] in judged for c in found if c in few]
            known = any(c[0] in judged for c in found)
            return (0 if any(told) else 1 if told else 2 if known else 3), k

        times = {k for k, found in progress.changes.items() if any(c in few for c in found)} | progress.again
        told = sorted(sorted(times, key=urgency)[:_MOST_SWITCHES])
        inputs = [r.name for r in self._view.space.inputs if r.name in trajectory.columns]
        outputs, texts = list(progress.ranges)[:_MOST_BESIDE], list[str]()
        jumping = {n: set(jumps(trajectory[n]).tolist()) for n in (*outputs, *inputs)} if told else {}
        for k in told:
            driven = [n for n in inputs if len(inputs) <= _MOST_BESIDE or k in jumping[n]][:_MOST_BESIDE]
            beside = {n: k in jumping[n] for n in (*outputs, *driven)}
            texts.append(self._change(progress, trajectory, beside, k))
        known = {c for k in told for c in progress.changes.get(k, ())}
        is_all = known.issuperset(new) and progress.again <= set(told)
        return "; ".join((*texts, *([] if is_all else ["..."])))

    def _change(
        self, progress: SampleProgress, trajectory: Trajectory, beside: Mapping[str, bool], k: int
    ) -> str:
        """All changes at an index, and signals beside them, with the value before if they jump there."""
        columns = trajectory.columns
        discrete = {name for name, _, _ in progress.stages}

        def told(name: str, *, jumps: bool) -> str:
            column = columns[name]
            new = value_text(self._view, name, float(column[k]), column_decimals(column))
            if not jumps:
                return f"{name} {new}"
            old = value_text(self._view, name, float(column[k - 1]), column_decimals(column))
            since = int(np.flatnonzero(np.diff(column[:k], prepend=np.nan))[-1])
            stay = (
                f" for {number(trajectory.times[k] - trajectory.times[since], 4)} s" if since < k - 1 else ""
            )
            return f"{name} {old}{stay} -> {new}"

        together = (
            self._stage((n, float(columns[n][k - 1]), float(columns[n][k])))
            for n in self._view.recorded
            if n in discrete and columns[n][k - 1] != columns[n][k]
        )
        words = f"{', '.join(together)} at {plain(trajectory.times[k], fine_clock(self._view))} s"
        others = ", ".join(told(name, jumps=jumps_there) for name, jumps_there in beside.items())
        return f"{words} ({others})" if others else words

    @property
    def same(self) -> frozenset[str]:
        """Signals that had one value, at all times in all samples."""
        found: defaultdict[str, set[float]] = defaultdict(set)
        for name, _, value in self._stages:
            found[name].add(value)
        for name, ends in self._ranges.items():
            found[name].update(ends)
        return frozenset(name for name, values in found.items() if len(values) == 1)

    def extent(self, told: Collection[str]) -> str:
        """Which signals were the same in all samples, unless it is told, and how far the others went."""
        values = {name for name, _, _ in self._stages}
        left = self.same.difference(told)
        same = [name for name in self._view.recorded if name in left]
        ranges = []
        for name, (low, high) in list(self._ranges.items())[:_MOST_BESIDE]:
            if low < high and name not in values:
                ends = (number(end, resolving(end, high - low, 3)) for end in (low, high))
                ranges.append(f"{name} {' to '.join(ends)}")
        found = [f"The same in all samples: {', '.join(same)}."] if same else []
        return "\n".join((*found, *([f"Ranges so far: {', '.join(ranges)}."] if ranges else [])))

    @staticmethod
    def _few(stages: Sequence[Stage], *, but_all_of: Collection[str] = ()) -> list[Stage]:
        """Of each signal its first stages and its last one: of a counter, not all."""
        by_name: dict[str, list[Stage]] = {}
        for stage in stages:
            by_name.setdefault(stage[0], []).append(stage)
        for name, found in by_name.items():
            if name not in but_all_of or len(found) > _MOST_OF_MODE:
                found[_MOST_OF_ONE - 1 :] = found[_MOST_OF_ONE - 1 :][-1:]
        return [stage for found in by_name.values() for stage in found]

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
        ends = (value_text(self._view, name, v) for v in (before, value) if v is not None)
        return f"{name} {' -> '.join(ends)}"

    def _passed(self, stage: Stage) -> bool:
        """Whether a signal that was not discrete in an earlier sample had this value there."""
        name, _, value = stage
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
