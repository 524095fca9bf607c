"""What a trajectory did: the marks that tell a simulation which reached something new from one that did not.

A mark is a value of a discrete signal, one of its changes, two changes one after the other with the time
between them, what all discrete signals were at the same time, a level that a continuous signal reached, or
how close a predicate came to its threshold. Levels, distances and times count in octaves, so that no scale
has to be known and marks do not multiply with the sampling rate.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from falsifier.core.trajectory import Trajectory, is_discrete
from falsifier.engines.layout import learnable
from falsifier.problem.problem import Problem
from falsifier.stl.formula import Predicate

Floats = NDArray[np.float64]

# Values above this one are modes by their octave only.
_EXACT = 16
# Half octaves below the largest deviation of a signal that still count as levels.
_LEVELS = 12
# Changes of a trajectory that are looked at; a signal that chatters would otherwise hide the others.
_MAX_CHANGES = 200
# Signals whose latest changes count as what happened before another one.
_MOST_BEFORE = 8
# Signals beside those of the formula that are looked at: each takes some 0.2 ms per simulation.
_MAX_SIGNALS = 200

# Source of the marks of all discrete signals together.
MODES = "the modes"


class Mark(NamedTuple):
    """Something that a trajectory did: the signal or predicate, and what it did."""

    source: str
    what: tuple[float | str, ...]


class Change(NamedTuple):
    """A change of a discrete signal or of a predicate; the sample is the first one with the new value."""

    sample: int
    source: str
    old: float
    new: float


class Marker:
    """Finds the marks of trajectories.

    Attributes:
        kinds: types of the signals that are looked at, no searched inputs, by name.
        predicates: predicates of the formula that depend on such a signal.
    """

    def __init__(self, problem: Problem) -> None:
        driven = {r.name for r in problem.space.inputs}
        formula = problem.requirement.formula
        outputs = dict.fromkeys((*problem.experiment.outputs, *formula.signals))
        others = [name for name in outputs if name not in driven and name not in formula.signals]
        left_out = driven.union(others[_MAX_SIGNALS:])
        self.kinds = {name: problem.info.kind(name) for name in outputs if name not in left_out}
        self.predicates = [p for p in formula.predicates if not driven.issuperset(p.signals)]

    def marks(self, trajectory: Trajectory) -> dict[Mark, float]:
        """Return the marks of a trajectory and the time in s at which each was reached first."""
        columns = {n: _finite(trajectory[n]) for n in self.kinds if n in trajectory.columns}
        discrete = {n: c for n, c in columns.items() if is_discrete(c, kind=self.kinds[n])}
        margins = {
            f"{p.left} > {p.right}": _margin(p, trajectory)
            for p in self.predicates
            if not discrete.keys() >= set(p.signals)
        }
        truths = {name: (margin > 0).astype(np.float64) for name, margin in margins.items()}
        found = [
            *(mark for name, column in discrete.items() for mark in _values(name, column)),
            *_modes({**discrete, **truths}),
            *_changes(sorted(_all_changes({**discrete, **truths}))[:_MAX_CHANGES]),
            *(mark for n, c in columns.items() if n not in discrete for mark in _levels(n, c)),
            *(mark for name, margin in margins.items() for mark in _nearness(name, margin)),
        ]
        first: dict[Mark, int] = {}
        for mark, sample in found:
            first[mark] = min(sample, first.get(mark, sample))
        return {mark: float(trajectory.times[sample]) for mark, sample in first.items()}


def _margin(predicate: Predicate, trajectory: Trajectory) -> Floats:
    columns = {name: _finite(trajectory[name]) for name in predicate.signals}
    margin = predicate.left.evaluate(columns) - predicate.right.evaluate(columns)
    return np.broadcast_to(_finite(margin), trajectory.times.shape)


def _finite(numbers: ArrayLike) -> Floats:
    values = learnable(numbers)
    return values if np.isfinite(values).all() else np.nan_to_num(values)


def _values(name: str, column: Floats) -> Iterator[tuple[Mark, int]]:
    values, samples = np.unique(column, return_index=True)
    for value, sample in zip(values.tolist(), samples.tolist(), strict=True):
        yield Mark(name, ("is", value)), sample


def _modes(columns: Mapping[str, Floats]) -> Iterator[tuple[Mark, int]]:
    """Yield what the discrete signals were at the same time, in words, with large numbers in octaves."""
    if len(columns) < 2:
        return
    table = np.stack([_coarse(column) for column in columns.values()])
    starts = np.flatnonzero((np.diff(table, axis=1) != 0).any(axis=0))[:_MAX_CHANGES] + 1
    for sample in (0, *starts.tolist()):
        values = zip(columns, table[:, sample].tolist(), strict=True)
        yield Mark(MODES, tuple(f"{name} = {value:g}" for name, value in values)), sample


def _coarse(column: Floats) -> Floats:
    size = np.abs(column)
    octave = np.floor(np.log2(np.maximum(size, 1.0)))
    return np.where(size > _EXACT, np.sign(column) * 2.0**octave, column)


def _all_changes(columns: Mapping[str, Floats]) -> Iterator[Change]:
    for name, column in columns.items():
        for sample in (np.flatnonzero(np.diff(column))[:_MAX_CHANGES] + 1).tolist():
            yield Change(sample, name, float(column[sample - 1]), float(column[sample]))


def _changes(changes: list[Change]) -> Iterator[tuple[Mark, int]]:
    """Yield the marks of changes in the order of time: each with its number (3 or 2^n), and those before."""
    counts: dict[tuple[str, float, float], int] = {}
    latest: dict[str, Change] = {}
    for change in changes:
        key = change.source, change.old, change.new
        counts[key] = counts.get(key, 0) + 1
        if (count := counts[key]).bit_count() == 1 or count == 3:
            yield Mark(change.source, ("changes", change.old, change.new, count)), change.sample
        for before in latest.values():
            gap = (change.sample - before.sample + 1).bit_length()  # in octaves
            what = "after", change.old, change.new, before.source, before.old, before.new, gap
            yield Mark(change.source, what), change.sample
        latest[change.source] = change
        if len(latest) > _MOST_BEFORE:
            del latest[min(latest, key=lambda source: latest[source].sample)]


def _levels(name: str, column: Floats) -> Iterator[tuple[Mark, int]]:
    """Yield the levels that a signal reached above and below its first value, in half octaves."""
    for direction, deviation in (("up", column - column[0]), ("down", column[0] - column)):
        largest = float(deviation.max())
        if largest <= 0.0:
            continue
        top = int(np.floor(2 * np.log2(largest)))
        levels = np.arange(top - _LEVELS + 1, top + 1)
        samples = np.searchsorted(np.maximum.accumulate(deviation), 2.0 ** (levels / 2))
        for level, sample in zip(levels.tolist(), samples.tolist(), strict=True):
            if sample < len(deviation):  # the logarithm may be rounded up to a level that is not reached
                yield Mark(name, (direction, level)), sample


def _nearness(name: str, margin: Floats) -> Iterator[tuple[Mark, int]]:
    """Yield how close a predicate came to the other side of its threshold, in half octaves."""
    distance = np.minimum.accumulate(margin if margin[0] > 0 else -margin)
    start = float(distance[0])
    if start <= 0.0:
        return
    samples = np.searchsorted(-distance, -start / 2.0 ** (np.arange(_LEVELS) / 2))
    for level, sample in enumerate(samples[samples < len(distance)].tolist()):
        yield Mark(name, ("near", level)), sample
