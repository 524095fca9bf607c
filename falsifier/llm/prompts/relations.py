"""Which signals are equal to others, or to sums or differences of two, in all samples so far."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.view import View

# Recorded signals and inputs among which relations are looked for, times of a sample, and relations told.
_MOST_RECORDED, _MOST_INPUTS, _TIMES, _MOST_TOLD = 12, 8, 2000, 6
# Share of its greatest size by which a signal may differ: results of other orders of operations do.
_SAME = 1e-9


class Relation(NamedTuple):
    """A signal as a sum of others, each with a sign."""

    name: str
    terms: tuple[tuple[int, str], ...]

    def __str__(self) -> str:
        (sign, first), *rest = self.terms
        others = (f" {'+' if sign > 0 else '-'} {name}" for sign, name in rest)
        return f"{self.name} = {'-' * (sign < 0)}{first}{''.join(others)}"

    @property
    def names(self) -> set[str]:
        """Of all its signals."""
        return {self.name, *(name for _, name in self.terms)}

    def holds(self, columns: Mapping[str, Array]) -> bool:
        """Whether it does, within rounding; not if a signal is missing."""
        if not columns.keys() >= self.names:
            return False
        values = columns[self.name]
        off = np.abs(values - sum(sign * columns[name] for sign, name in self.terms))
        return float(off.max()) <= _SAME * float(np.abs(values).max())


@dataclass(slots=True)
class Relations:
    """Drops relations as samples show that they do not hold."""

    view: View
    _left: list[Relation] | None = None  # None: no sample was seen
    _moved: set[str] = field(default_factory=set)

    def add(self, trajectory: Trajectory) -> None:
        """Add a sample."""
        every = max(1, len(trajectory) // _TIMES)
        columns = trajectory.columns
        few = {name: column[::every] for name, column in columns.items()}  # most are dropped by these
        known = self._possible(columns) if self._left is None else self._left
        self._left = [r for r in known if r.holds(few) and r.holds(columns)]
        self._moved |= {name for name, column in columns.items() if np.ptp(column) > 0}

    @property
    def text(self) -> str:
        """Those of signals that moved, the simplest one of each; empty if there is none."""
        told: dict[str, Relation] = {}
        for relation in self._left or ():
            if relation.names <= self._moved and told.keys().isdisjoint(relation.names):
                told[relation.name] = relation
        few = list(map(str, told.values()))[:_MOST_TOLD]
        return f"In all samples so far: {'; '.join(few)}." if few else ""

    def _possible(self, columns: Mapping[str, Array]) -> Iterator[Relation]:
        """All of them, simple ones first, of signals that others are less likely to be made of first."""
        recorded = [name for name in self.view.recorded if name in columns][:_MOST_RECORDED]
        inputs = [r.name for r in self.view.space.inputs if r.name in columns][:_MOST_INPUTS]
        others = {name: [n for n in dict.fromkeys((*inputs, *recorded)) if n != name] for name in recorded}
        for name in reversed(recorded):
            yield from (Relation(name, ((sign, one),)) for one in others[name] for sign in (1, -1))
        for name in reversed(recorded):
            for one, two in combinations(others[name], 2):
                yield from (Relation(name, terms) for terms in (((1, one), (1, two)), ((1, one), (-1, two))))
                yield Relation(name, ((1, two), (-1, one)))
