"""The different values of robustness of a search; where they are few, what is missing for a lower one."""

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.core.words import counted
from falsifier.stl.breach import compared_sides
from falsifier.stl.diagnosis import valued
from falsifier.stl.formula import Predicate, negated
from falsifier.stl.margins import signed
from falsifier.stl.monitor import Verdict

# Two values of robustness that differ by less than this share of the larger one are the same level.
_SAME = 1e-6
# Robustness is a staircase if it has at most one value per so many simulations, from so many values on.
_PER_LEVEL, _FEWEST = 4, 2
# The lowest levels that are told.
_TOLD = 5
# A signal without names of its values that makes more steps counts something without an end, such as events.
_MOST_STEPS = 12


@dataclass(slots=True)
class Level:
    """One value of robustness."""

    robustness: float  # the value
    first: int  # number of the first simulation that reached it, from 1
    simulations: int = 1  # number of simulations that had it


@dataclass(slots=True)
class Levels:
    """The different values of robustness so far, the lowest first."""

    found: list[Level] = field(default_factory=list)
    simulations: int = 0

    @property
    def lowest(self) -> float:
        """The lowest robustness; inf before the first one."""
        return self.found[0].robustness if self.found else inf

    @property
    def is_plateau(self) -> bool:
        """Whether all of several simulations had the same robustness."""
        return self.simulations >= _PER_LEVEL and len(self.found) == 1

    @property
    def is_staircase(self) -> bool:
        """Whether many simulations had few different values of robustness, which lead down in steps."""
        count = len(self.found)
        return count >= _FEWEST and self.simulations >= _PER_LEVEL * count

    def add(self, robustness: float, number: int | None = None) -> int | None:
        """Add a simulation; return the place of its level if it is a new one.

        Simulations are numbered from 1, by default in the order in which they are added.
        """
        self.simulations += 1
        place = bisect_left(self.found, robustness, key=lambda level: level.robustness)
        for level in self.found[max(0, place - 1) : place + 1]:
            if abs(robustness - level.robustness) <= _SAME * max(abs(level.robustness), abs(robustness)):
                level.simulations += 1
                return None
        self.found.insert(place, Level(robustness, number or self.simulations))
        return place

    def told(self, noun: str) -> str:
        """Say how many simulations had each of the lowest levels, and which was the first."""
        parts = [
            f"{signed(level.robustness)} in {level.simulations}, first in {noun} {level.first}"
            for level in self.found[:_TOLD]
        ]
        more = [counted(len(self.found) - _TOLD, "higher value")] if len(self.found) > _TOLD else []
        return f"robustness in {counted(self.simulations, noun)}: {'; '.join([*parts, *more])}"


@dataclass(slots=True)
class Climb:
    """What simulations show of the way down a staircase of robustness: how far it led, what is missing."""

    # The discrete signals that may count up, and the names of their values as far as they have any.
    labels: Mapping[str, Mapping[int, str]]
    noun: str = "simulation"  # what a simulation is called
    levels: Levels = field(default_factory=Levels)  # the values of robustness
    trajectories: int = 0  # number of simulations whose trajectory is known
    _lowest: tuple[Predicate, Verdict] | None = None
    # Numbers of the simulations in which a predicate was so, and in which a signal had a value.
    _met: defaultdict[tuple[str, bool], list[int]] = field(default_factory=lambda: defaultdict(list))
    _values: defaultdict[tuple[str, int], list[int]] = field(default_factory=lambda: defaultdict(list))
    _rises: defaultdict[str, set[tuple[int, int]]] = field(default_factory=lambda: defaultdict(set))

    def add(
        self, number: int, verdict: Verdict, trajectory: Trajectory | None, predicates: Sequence[Predicate]
    ) -> None:
        """Add a simulation.

        Its number counts from 1; its trajectory may be unknown. The predicates are those of the requirement.
        """
        if self.levels.add(verdict.robustness, number) == 0:
            known = _known(predicates, verdict.values)  # engines may be told verdicts without values
            decider = next((p for p in known if str(p) == verdict.predicate), None)
            self._lowest = None if decider is None else (decider, verdict)
        if trajectory is None:
            return
        self.trajectories += 1
        for predicate in _known(predicates, trajectory.columns):
            for truth in np.unique(predicate.holds(trajectory.columns)).tolist():
                self._met[str(predicate), truth].append(number)
        for name in self.labels.keys() & trajectory.columns.keys():
            column = trajectory[name]
            kept = column[np.flatnonzero(np.diff(column, prepend=np.nan))]
            if np.array_equal(kept, np.round(kept)):
                values = kept.astype(int).tolist()
                for value in set(values):
                    self._values[name, value].append(number)
                self._rises[name].update((a, b) for a, b in pairwise(values) if a < b)
            else:  # such as one that is told in another scale; this rise says that it does not count
                self._rises[name].add((0, 2))

    @property
    def is_told(self) -> bool:
        """Whether there are few levels, and no violation."""
        return self.levels.lowest >= 0 and (self.levels.is_plateau or self.levels.is_staircase)

    @property
    def decider(self) -> Predicate | None:
        """The comparison that decides the lowest level, of which the first line tells; None if unknown."""
        return self._lowest and self._lowest[0]

    @property
    def lines(self) -> list[str]:
        """What is missing for a lower level."""
        return [*self._decided(), *self._counting()]

    def _decided(self) -> Iterator[str]:
        """The comparison that decides the lowest level, and whether what a violation needs ever held."""
        if self._lowest is None:
            return
        predicate, verdict = self._lowest
        is_true = bool(predicate.holds(verdict.values))
        needed = negated(predicate) if is_true else predicate
        value = valued(compared_sides(predicate)[0], verdict.values, verdict.robustness)
        met = self._met[str(predicate), not is_true]
        text = f"{predicate} decided the lowest robustness, with {value}; a violation there takes {needed}"
        if met:
            text += f", which held in {self._of(met)}, but not when that violates the requirement"
        elif self.trajectories:
            text += f", which held in none of {self._all}"
        yield f"{text}."

    def _counting(self) -> Iterator[str]:
        """Signals that only ever rose by one, and the next step that was never made."""
        for name, rises in sorted(self._rises.items()):
            if not rises or any(after - before != 1 for before, after in rises):
                continue
            labels, top = self.labels[name], max(after for _, after in rises)
            reached = self._values[name, top]
            # Without names of values, nothing says that a signal that always gets so far could go further.
            is_rare = 2 * len(reached) <= self.trajectories
            is_hindered = is_rare and _FEWEST <= len(rises) <= _MOST_STEPS
            if top + 1 in labels if labels else is_hindered:
                here, following = (labels.get(value, str(value)) for value in (top, top + 1))
                yield (
                    f"{name} counts up: it reached {here} in {self._of(reached)}; the step from {here} to "
                    f"{following} was never made."
                )

    @property
    def _all(self) -> str:
        kept = "" if self.trajectories == self.levels.simulations else " with a kept trajectory"
        return f"{counted(self.trajectories, self.noun)}{kept}"

    def _of(self, numbers: Sequence[int]) -> str:
        return f"{len(numbers)} of {self._all}, first in {self.noun} {numbers[0]}"


def _known(predicates: Sequence[Predicate], values: Mapping[str, Any]) -> list[Predicate]:
    """Return those whose signals all have values."""
    return [p for p in predicates if values.keys() >= set(p.signals)]
