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


def paced(layout: Layout, rng: np.random.Generator, most_pieces: int, at_bounds: float) -> Array:
    """Return one point: all inputs change together and keep their last levels; shape (d,).

    Together means at the same share of the control points of each, which is the same time if these cover the
    same time.

    Each order of magnitude of a piece's length is equally likely, so that short pulses, after which nothing
    changes any more, are as likely as slow changes. Parameters get any values: extremes are tried anyway.

    Args:
        layout: layout of the point.
        rng: random generator.
        most_pieces: maximum number of pieces; each number is equally likely.
        at_bounds: probability that a level is a bound.
    """
    pieces = int(rng.integers(1, most_pieces + 1))
    cells = max((len(group) for group in layout.groups), default=1)
    ends = np.cumsum(np.exp(rng.random(pieces - 1) * np.log(cells)) // 1) / cells
    values = []
    for group in layout.groups[: len(layout.codings)]:
        levels = _levels(rng, pieces, at_bounds)
        values.append(levels[np.searchsorted(ends, np.arange(len(group)) / len(group), side="right")])
    return layout.settled(np.concatenate([*values, rng.random(len(layout.space.parameters))]))


def held_from(
    layout: Layout, rng: np.random.Generator, points: Array, until: Array, at_bounds: float
) -> Array:
    """Return a copy of the points in which all inputs are constant from a random time on; shape (m, d).

    Args:
        layout: layout of the points.
        rng: random generator.
        points: shape (m, d).
        until: latest time in s at which the constant end begins, shape (m,).
        at_bounds: probability that a constant is a bound.
    """
    result = points.copy()
    starts = rng.random(len(points)) * np.minimum(until, layout.starts.max(initial=0.0))
    for group in layout.groups[: len(layout.codings)]:
        levels = _levels(rng, len(points), at_bounds)
        is_end = layout.starts[group] >= starts[:, None]
        result[:, group] = np.where(is_end, levels[:, None], points[:, group])
    return layout.settled(result)


def _levels(rng: np.random.Generator, count: int, at_bounds: float) -> Array:
    """Draw levels in [0, 1], at a bound with the given probability, shape (count,)."""
    levels = rng.random(count)
    return np.where(rng.random(count) < at_bounds, np.rint(levels), levels)


def _groups(layout: Layout) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the end of each group of coordinates, and whether it consists of many held cells."""
    return np.array([group[-1] + 1 for group in layout.groups]), np.array(layout.is_fine)
