"""Random points in a layout, and random changes of good ones.

A plan needs thousands, so all are drawn and changed at once.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array
from falsifier.engines.layout import Layout

# Standard deviations of small changes, as shares of a range: coarse, medium and fine, equally likely.
_STEPS = np.array([0.3, 0.1, 0.03])
# Cumulative probabilities of the changes of held cells: a bound, any level, a small step, a switch moved
# in time; the rest shifts the whole signal.
_TO_BOUND, _TO_LEVEL, _STEPPED, _SWITCH_MOVED = 0.35, 0.5, 0.65, 0.85
# Maximum shift in time, as a share of the horizon.
_REACH = 0.05

Bools = NDArray[np.bool_]
Ints = NDArray[np.intp]


def random_points(layout: Layout, rng: np.random.Generator, count: int) -> Array:
    """Return structured random points, shape (count, d): with few or many pieces, at bounds or in between."""
    points = np.empty((count, layout.dimension))
    for block in _blocks(layout):
        draw = _random_pieces if block.is_fine else _random_levels
        rows = draw(rng, count * len(block.groups), block.size)
        points[:, block.groups] = rows.reshape(count, len(block.groups), block.size)
    return points


def mutations(
    layout: Layout,
    rng: np.random.Generator,
    parents: Array,
    count: int,
    *,
    critical: Array | None = None,
) -> Array:
    """Return children, shape (count, d), each with one to three changes of a parent, some also crossed over.

    Args:
        layout: layout of the points.
        rng: random generator.
        parents: points to change, shape (p, d).
        count: number of children.
        critical: critical time of each parent as a share of the horizon, shape (p,), or None if unknown. If
            known, half of the changes of held cells end there, because only earlier inputs led to it.
    """
    chosen = rng.integers(0, len(parents), count)
    children = parents[chosen].copy()
    crossed = np.flatnonzero(rng.random(count) < 0.25)
    others = parents[rng.integers(0, len(parents), len(crossed))]
    children[crossed] = _crossed_over(layout, rng, children[crossed], others)
    changes = rng.integers(1, 4, count)
    for number in range(3):
        # Of each child that still changes, one group.
        group = np.where(changes > number, rng.integers(0, len(layout.groups), count), -1)
        for block in _blocks(layout):
            rows = np.flatnonzero((group >= block.first) & (group < block.first + len(block.groups)))
            if not len(rows):
                continue
            columns = block.groups[group[rows] - block.first]
            values = children[rows[:, None], columns]
            if block.is_fine:
                until = np.full(len(rows), np.nan)
                if critical is not None:
                    until = np.where(rng.random(len(rows)) < 0.5, np.nan, critical[chosen[rows]])
                values = _change_pieces(rng, values, until)
            else:
                values = _change_points(rng, values)
            children[rows[:, None], columns] = values
    return children


def switching(layout: Layout, rng: np.random.Generator, dwell: float) -> Array:
    """Return one point: every ``dwell`` s, with a random phase, each input is set to a random bound."""
    point = np.empty(layout.dimension)
    for j, group in enumerate(layout.groups):
        if j >= len(layout.codings):
            point[group] = rng.random()
            continue
        piece = (np.asarray(layout.codings[j].times) / dwell + rng.random()).astype(int)
        point[group] = rng.integers(0, 2, int(piece[-1]) + 1)[piece]
    return point


def stepping(layout: Layout, rng: np.random.Generator, pieces: int) -> Array:
    """Return one point: each input steps through evenly spread levels in random order, all equally long."""
    point = np.empty(layout.dimension)
    for group in layout.groups:
        count = min(pieces, len(group))
        levels = (rng.permutation(count) + rng.random(count)) / count
        point[group] = levels[np.arange(len(group)) * count // len(group)]
    return point


@dataclass(frozen=True, slots=True, eq=False)
class _Block:
    """Successive groups of coordinates of the same size and kind, which are drawn and changed together.

    Attributes:
        first: index of the first group.
        groups: indices of the coordinates, shape (groups, size).
        is_fine: whether the groups consist of many held cells.
    """

    first: int
    groups: Ints
    is_fine: bool

    @property
    def size(self) -> int:
        return int(self.groups.shape[1])


def _blocks(layout: Layout) -> Iterator[_Block]:
    kinds = [(len(group), fine) for group, fine in zip(layout.groups, layout.is_fine, strict=True)]
    first = 0
    for end in range(1, len(kinds) + 1):
        if end == len(kinds) or kinds[end] != kinds[first]:
            yield _Block(first, np.array(layout.groups[first:end]), kinds[first][1])
            first = end


def _random_pieces(rng: np.random.Generator, count: int, size: int) -> Array:
    """Return held signals, shape (count, size); each order of magnitude of their pieces is equally likely."""
    pieces = np.clip(np.exp(rng.uniform(0, np.log(size + 1), count)).astype(int), 1, size)
    order = rng.random((count, size), dtype=np.float32)
    # The first cell starts the first piece; of the others, those with the smallest numbers start the rest.
    order[:, 0] = -1.0
    last = np.sort(order, axis=1)[np.arange(count), pieces - 1]
    piece = np.cumsum(order <= last[:, None], axis=1) - 1
    levels = rng.random((count, size))
    levels = np.where(rng.random((count, 1)) < 0.6, np.round(levels), levels)
    return np.take_along_axis(levels, piece, axis=1)


def _random_levels(rng: np.random.Generator, count: int, size: int) -> Array:
    """Return control points, shape (count, size): at bounds or anywhere, equal to the last one or not."""
    values = rng.random((count, size))
    values = np.where(rng.random((count, 1)) < 0.5, np.round(values), values)
    stays = rng.random((count, size)) < 0.9 * rng.random((count, 1))
    stays[:, 0] = False
    source = np.maximum.accumulate(np.where(stays, 0, np.arange(size)), axis=1)
    return np.take_along_axis(values, source, axis=1)


def _crossed_over(layout: Layout, rng: np.random.Generator, points: Array, others: Array) -> Array:
    """Replace the points' signals with the others' from a random time on, and each parameter at random."""
    share = rng.random((len(points), 1))
    taken = np.empty(points.shape, dtype=bool)
    for j, group in enumerate(layout.groups):
        if j < len(layout.codings):
            taken[:, group] = np.arange(len(group)) >= (share * len(group)).astype(int)
        else:
            taken[:, group] = rng.random((len(points), 1)) < 0.5
    return np.where(taken, others, points)


def _change_pieces(rng: np.random.Generator, values: Array, until: Array) -> Array:
    """Change held signals, shape (m, size), each in one way, up to ``until``, shape (m,), where not NaN."""
    count, size = values.shape
    kind = rng.random((count, 1))
    cells = np.arange(size)
    inside = _stretch(rng, until, size)
    level = np.where(kind < _TO_BOUND, rng.integers(0, 2, (count, 1)), rng.random((count, 1)))
    stepped = np.clip(values + rng.choice(_STEPS, (count, 1)) * rng.standard_normal((count, 1)), 0.0, 1.0)
    changed = np.where(kind < _TO_LEVEL, level, stepped)
    result = np.where(inside & (kind < _STEPPED), changed, values)
    reach = max(1, int(_REACH * size))
    moved = np.flatnonzero((kind[:, 0] >= _STEPPED) & (kind[:, 0] < _SWITCH_MOVED))
    result[moved] = _switch_moved(rng, values[moved], reach)
    rolled = np.flatnonzero(kind[:, 0] >= _SWITCH_MOVED)
    shift = rng.integers(-reach, reach + 1, (len(rolled), 1))
    result[rolled] = np.take_along_axis(values[rolled], (cells - shift) % size, axis=1)
    return result


def _stretch(rng: np.random.Generator, until: Array, size: int) -> Bools:
    """Return random stretches of cells, shape (m, size), of any order of magnitude."""
    count = len(until)
    length = np.maximum(1, np.exp(rng.uniform(0, np.log(size), count)).astype(int))
    start = rng.integers(0, size, count)
    known = ~np.isnan(until)
    stop = np.minimum(
        size, np.where(known, np.where(known, until, 0.0) * size + 1, start + length).astype(int)
    )
    start = np.where(known, np.maximum(0, stop - length), start)
    cells = np.arange(size)
    return np.asarray((cells >= start[:, None]) & (cells < stop[:, None]))


def _switch_moved(rng: np.random.Generator, values: Array, reach: int) -> Array:
    """Move one switch of each signal, shape (m, size), to an earlier or a later cell."""
    count, size = values.shape
    if size < 2 or not count:
        return values
    switches = np.diff(values, axis=1) != 0
    at = np.argmax(switches * rng.uniform(0.5, 1.0, switches.shape), axis=1)[:, None]
    shift = rng.integers(1, reach + 1, (count, 1))
    cells = np.arange(size)
    earlier = rng.random((count, 1)) < 0.5
    before, after = np.take_along_axis(values, at, axis=1), np.take_along_axis(values, at + 1, axis=1)
    overwritten = np.where(
        earlier, (cells > at - shift) & (cells <= at), (cells > at) & (cells <= at + shift)
    )
    overwritten &= switches.any(axis=1)[:, None]
    return np.where(overwritten, np.where(earlier, after, before), values)


def _change_points(rng: np.random.Generator, values: Array) -> Array:
    """Change some of the control points, shape (m, size), at least one in each row."""
    count, size = values.shape
    chosen = rng.random((count, size)) < rng.choice([0.2, 0.5], (count, 1))
    chosen[np.arange(count), rng.integers(0, size, count)] = True
    kind = rng.random((count, size))
    step = rng.choice(_STEPS, (count, 1)) * rng.standard_normal((count, size))
    moved = np.clip(values + step, 0.0, 1.0)
    moved = np.where(kind < 0.1, rng.integers(0, 2, (count, size)), moved)
    moved = np.where(kind > 0.95, rng.random((count, size)), moved)
    return np.where(chosen, moved, values)
