"""Random points in a layout, and random changes of good ones."""

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array
from falsifier.engines.layout import Layout

# Share of children that are crossed over with another parent.
_CROSSED = 0.25


def random_points(layout: Layout, rng: np.random.Generator, count: int) -> Array:
    """Return structured random points, shape (count, d): with few or many pieces, at bounds or in between."""
    from falsifier.engines.surrogate.breeding import draw

    points = np.empty((count, layout.dimension))
    draw(points, *_groups(layout), rng)
    return layout.settled(points)


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
    from falsifier.engines.surrogate.breeding import change, cross

    chosen = rng.integers(0, len(parents), count)
    children = parents[chosen]
    ends, is_fine = _groups(layout)
    cross(children, parents, ends, len(layout.codings), _CROSSED, rng)
    until = np.full(count, np.nan) if critical is None else critical[chosen]
    change(children, until, ends, is_fine, rng)
    return layout.settled(children)


def changed(layout: Layout, rng: np.random.Generator, points: Array) -> Array:
    """Return a copy of the points, shape (m, d), each with one to three random changes."""
    from falsifier.engines.surrogate.breeding import change

    result = points.copy()
    change(result, np.full(len(points), np.nan), *_groups(layout), rng)
    return layout.settled(result)


def switching(layout: Layout, rng: np.random.Generator, dwell: float) -> Array:
    """Return one point: every ``dwell`` s, with a random phase, each input is set to a random bound."""
    point = np.empty(layout.dimension)
    for j, group in enumerate(layout.groups):
        if j >= len(layout.codings):
            point[group] = rng.random()
            continue
        piece = (np.asarray(layout.codings[j].times) / dwell + rng.random()).astype(int)
        point[group] = rng.integers(0, 2, int(piece[-1]) + 1)[piece]
    return layout.settled(point)


def stepping(layout: Layout, rng: np.random.Generator, pieces: int) -> Array:
    """Return one point: each input steps through evenly spread levels in random order, all equally long."""
    point = np.empty(layout.dimension)
    for group in layout.groups:
        count = min(pieces, len(group))
        levels = (rng.permutation(count) + rng.random(count)) / count
        point[group] = levels[np.arange(len(group)) * count // len(group)]
    return layout.settled(point)


def _groups(layout: Layout) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the end of each group of coordinates, and whether it consists of many held cells."""
    return np.array([group[-1] + 1 for group in layout.groups]), np.array(layout.is_fine)
