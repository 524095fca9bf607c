"""Random points in a layout, and random changes of good ones."""

import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.layout import Layout

# Standard deviations of small changes, as shares of a range: coarse, medium and fine, equally likely.
_STEPS = np.array([0.3, 0.1, 0.03])


def random_points(layout: Layout, rng: np.random.Generator, count: int) -> Array:
    """Return structured random points, shape (count, d): with few or many pieces, at bounds or in between."""
    points = np.empty((count, layout.dimension))
    for row in points:
        for group, fine in zip(layout.groups, layout.is_fine, strict=True):
            size = len(group)
            if fine:
                # Every order of magnitude of the number of pieces is equally likely.
                pieces = min(size, max(1, int(np.exp(rng.uniform(0, np.log(size + 1))))))
                starts = np.zeros(size, dtype=int)
                starts[rng.choice(np.arange(1, size), pieces - 1, replace=False)] = 1
                values = rng.integers(0, 2, pieces) if rng.random() < 0.6 else rng.random(pieces)
                row[group] = values[np.cumsum(starts)]
            else:
                values = rng.random(size)
                row[group] = np.round(values) if rng.random() < 0.5 else values
                stay = rng.random(size) < rng.random() * 0.9
                for k in range(1, size):
                    if stay[k]:
                        row[group[k]] = row[group[k - 1]]
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
    for child, parent in zip(children, chosen, strict=True):
        if rng.random() < 0.25:
            _cross_over(layout, rng, child, parents[rng.integers(len(parents))])
        for _ in range(1 + int(rng.integers(3))):
            index = int(rng.integers(len(layout.groups)))
            group = layout.groups[index]
            if layout.is_fine[index]:
                until = None if critical is None or rng.random() < 0.5 else critical[parent]
                child[group] = _change_pieces(rng, child[group], until)
            else:
                child[group] = _change_points(rng, child[group])
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


def _cross_over(layout: Layout, rng: np.random.Generator, child: Array, other: Array) -> None:
    """Replace the child's signals with the other's from a random time on, and each parameter at random."""
    share = rng.random()
    for j, group in enumerate(layout.groups):
        if j < len(layout.codings):
            child[group[int(share * len(group)) :]] = other[group[int(share * len(group)) :]]
        elif rng.random() < 0.5:
            child[group] = other[group]


def _change_pieces(rng: np.random.Generator, values: Array, until: float | None) -> Array:
    size = len(values)
    length = max(1, int(np.exp(rng.uniform(0, np.log(size)))))
    if until is None:
        start = int(rng.integers(size))
        stop = min(size, start + length)
    else:
        stop = min(size, int(until * size) + 1)
        start = max(0, stop - length)
    reach = max(1, size // 20)
    values = values.copy()
    kind = rng.random()
    if kind < 0.35:
        values[start:stop] = rng.integers(0, 2)
    elif kind < 0.5:
        values[start:stop] = rng.random()
    elif kind < 0.65:
        moved = values[start:stop] + rng.choice(_STEPS) * rng.standard_normal()
        values[start:stop] = np.clip(moved, 0.0, 1.0)
    elif kind < 0.85:
        switches = np.flatnonzero(np.diff(values))
        if len(switches):
            at, shift = int(rng.choice(switches)), int(rng.integers(1, reach + 1))
            if rng.random() < 0.5:
                values[max(0, at - shift + 1) : at + 1] = values[at + 1]
            else:
                values[at + 1 : at + 1 + shift] = values[at]
    else:
        values = np.roll(values, int(rng.integers(-reach, reach + 1)))
    return values


def _change_points(rng: np.random.Generator, values: Array) -> Array:
    size = len(values)
    chosen = rng.random(size) < rng.choice([0.2, 0.5])
    chosen[rng.integers(size)] = True
    kind = rng.random(size)
    moved = np.clip(values + rng.choice(_STEPS) * rng.standard_normal(size), 0.0, 1.0)
    moved = np.where(kind < 0.1, rng.integers(0, 2, size), moved)
    moved = np.where(kind > 0.95, rng.random(size), moved)
    return np.where(chosen, moved, values)
