"""Random points in a layout, and random changes of good ones, many at a time or chosen without dynamics."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.layout import Array, Layout

# Share of children that are crossed over with another parent.
_CROSSED = 0.25
# Cumulative probabilities of the changes of held cells: a bound, any level, a small step, a switch moved
# in time; the rest shifts the whole signal.
_TO_BOUND, _TO_LEVEL, _STEPPED, _SWITCH_MOVED = 0.35, 0.5, 0.65, 0.85
# The same for control points: a bound, a small step; the rest to any level.
_POINT_TO_BOUND, _POINT_STEPPED = 0.1, 0.95
# Standard deviations of a small step: coarse, medium or fine, equally likely.
_STEPS = (0.3, 0.1, 0.03)
# Maximum shift in time, as a share of the horizon.
_REACH = 0.05
# Of what is tried without a plan, the maximum number of pieces of a random point, and the probability that a
# level of it, or of a constant end, is a bound.
_PIECES, _AT_BOUND = 6, 0.8
# Changes that are drawn for one proposal; the first that matters is taken.
_TRIES = 100
# Mean rank, from 0, of the point that is changed.
_MEAN_RANK = 0.5
# Number of simulations before their changes are tried; share of random points later.
_FEWEST, _FRESH = 8, 0.05
# Share of changes that keep all inputs constant from some time on: an excited system that is left alone may
# do by itself what constant disturbance hides.
_HELD = 0.2
_TOLERANCE = 1e-9

Bools = NDArray[np.bool_]


def random_points(layout: Layout, rng: np.random.Generator, count: int) -> Array:
    """Return structured random points, shape (count, d): with few or many pieces, at bounds or in between."""
    points = np.empty((count, layout.dimension))
    for group, fine in zip(layout.groups, layout.is_fine, strict=True):
        size = len(group)
        if fine:  # each order of magnitude of the number of pieces is equally likely
            share = np.exp(rng.random((count, 1)) * np.log(size + 1)) / size
        else:
            share = 1.0 - 0.9 * rng.random((count, 1))
        begins = rng.random((count, size)) < share
        begins[:, 0] = False
        levels = _levels(rng, (count, size), at_bounds=rng.random((count, 1)) < 0.6)
        points[:, group] = np.take_along_axis(levels, np.cumsum(begins, axis=1), axis=1)
    return layout.settled(points)


def mutations(
    layout: Layout, rng: np.random.Generator, parents: Array, count: int, *, critical: Array | None = None
) -> Array:
    """Return children, shape (count, d), each with one to three changes of a parent, some also crossed over.

    ``critical`` are the critical times of the parents, shape (p, d), as shares of the horizon, shape (p,). If
    known, half of the changes of held cells end there, because only earlier inputs led to it.
    """
    chosen = rng.integers(0, len(parents), count)
    children = _crossed(layout, rng, parents[chosen], parents)
    return _changed(layout, rng, children, None if critical is None else critical[chosen])


def propose_change(
    layout: Layout,
    points: Array,
    costs: Array,
    decided: Array,
    rng: np.random.Generator,
    *,
    risk: Callable[[Array], Array],
    draws: int,
) -> tuple[Array, str]:
    """Return a change of one of the best points, or a random point, and what it is.

    What comes after the time in s by which the inputs had ``decided`` a cost, shape (n,), cannot lower it, so
    such changes are not proposed. ``points`` were simulated, shape (n, d). Of ``draws`` random points, the
    one with the least ``risk`` is chosen: from 0 to 1, how likely the simulations of points fail, shape (m,).
    """
    if len(costs) >= _FEWEST and rng.random() >= _FRESH:
        children = _changes(layout, points, costs, decided, rng)
        if len(children):
            return children[np.argmin(risk(children))], "a change of one of the best candidates"
    fresh = np.array([_paced(layout, rng) for _ in range(draws)])
    return fresh[np.argmin(risk(fresh))], "random: a new start of the search by changes"


def switching(layout: Layout, rng: np.random.Generator, dwell: float) -> Array:
    """Return one point: every ``dwell`` s, with a random phase, each input is set to a random bound."""
    point = rng.random(layout.dimension)
    for coding, group in zip(layout.codings, layout.groups, strict=False):
        piece = (np.asarray(coding.times) / dwell + rng.random()).astype(int)
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


def _paced(layout: Layout, rng: np.random.Generator) -> Array:
    """Return one point: all inputs change together and keep their last levels; shape (d,).

    Together means at the same share of the control points of each, which is the same time if these cover the
    same time.

    Each order of magnitude of a piece's length is equally likely, so that short pulses, after which nothing
    changes any more, are as likely as slow changes. Parameters get any values: extremes are tried anyway.
    """
    pieces = int(rng.integers(1, _PIECES + 1))
    cells = max((len(group) for group in layout.groups), default=1)
    ends = np.cumsum(np.exp(rng.random(pieces - 1) * np.log(cells)) // 1) / cells
    point = rng.random(layout.dimension)
    for group in layout.groups[: len(layout.codings)]:
        levels = _levels(rng, pieces, at_bounds=rng.random(pieces) < _AT_BOUND)
        point[group] = levels[np.searchsorted(ends, np.arange(len(group)) / len(group), side="right")]
    return layout.settled(point)


def _held_from(layout: Layout, rng: np.random.Generator, points: Array, until: Array) -> Array:
    """Return a copy of the points, shape (m, d), in which all inputs are constant from a random time on.

    That time is at most ``until``, in s, shape (m,).
    """
    result = points.copy()
    starts = rng.random(len(points)) * np.minimum(until, layout.starts.max(initial=0.0))
    for group in layout.groups[: len(layout.codings)]:
        levels = _levels(rng, len(points), at_bounds=rng.random(len(points)) < _AT_BOUND)
        is_end = layout.starts[group] >= starts[:, None]
        result[:, group] = np.where(is_end, levels[:, None], points[:, group])
    return layout.settled(result)


def _changes(layout: Layout, points: Array, costs: Array, decided: Array, rng: np.random.Generator) -> Array:
    """Return changes of good points that can matter, shape (m, d); m may be 0."""
    # Among equal costs, any order: the first one would else be changed for ever.
    order = np.lexsort((rng.random(len(costs)), costs))
    chosen = order[np.minimum(rng.exponential(_MEAN_RANK, _TRIES).astype(np.intp), len(order) - 1)]
    parents, decided = points[chosen], decided[chosen]
    children = _changed(layout, rng, parents.copy(), None)
    held = rng.random(_TRIES) < _HELD
    children[held] = _held_from(layout, rng, parents[held], decided[held])
    early = layout.starts[None] <= decided[:, None]
    matters = ((np.abs(children - parents) > _TOLERANCE) & early).any(axis=1)
    return np.asarray(children[matters])


def _levels(rng: np.random.Generator, shape: int | tuple[int, ...], *, at_bounds: Bools) -> Array:
    """Draw levels in [0, 1], where wanted at a bound."""
    levels = rng.random(shape)
    return np.where(at_bounds, np.rint(levels), levels)


def _crossed(layout: Layout, rng: np.random.Generator, children: Array, parents: Array) -> Array:
    """Replace the signals of a share of children with another parent's from a random time on."""
    rows = np.flatnonzero(rng.random(len(children)) < _CROSSED)
    others = parents[rng.integers(0, len(parents), len(rows))]
    time = rng.random((len(rows), 1))
    for j, group in enumerate(layout.groups):
        if j >= len(layout.codings):  # a parameter is the other parent's or not
            time = rng.random((len(rows), 1)) * 2 - 1
        later = np.arange(len(group)) / len(group) >= time
        children[np.ix_(rows, group)] = np.where(later, others[:, group], children[np.ix_(rows, group)])
    return children


def _changed(layout: Layout, rng: np.random.Generator, children: Array, until: Array | None) -> Array:
    """Change one group of each child, one to three times, in place."""
    times = rng.integers(1, 4, len(children))
    group_of = np.repeat(np.arange(len(layout.groups)), [len(group) for group in layout.groups])
    is_fine = np.array(layout.is_fine)
    for turn in range(3):
        which = np.where(turn < times, rng.integers(0, len(layout.groups), len(children)), -1)
        for j in np.unique(which[(which >= 0) & is_fine[which]]):
            rows = np.flatnonzero(which == j)
            here = np.ix_(rows, layout.groups[j])
            children[here] = _changed_pieces(children[here], None if until is None else until[rows], rng)
        rows = np.flatnonzero((which >= 0) & ~is_fine[which])
        children[rows] = _changed_control_points(children[rows], group_of == which[rows, None], rng)
    return layout.settled(children)


def _changed_pieces(values: Array, until: Array | None, rng: np.random.Generator) -> Array:
    """Return held signals, shape (m, cells), each changed in one way."""
    count, size = values.shape
    cells, kind, reach = np.arange(size), rng.random((count, 1)), max(1, int(_REACH * size))
    # A stretch of any order of magnitude.
    length = np.maximum(1, np.exp(rng.random(count) * np.log(size)).astype(np.intp))
    start = (size * rng.random(count)).astype(np.intp)
    stop = start + length
    if until is not None:
        ends_there = rng.random(count) < 0.5
        stop = np.where(ends_there, (until * size).astype(np.intp) + 1, stop)
        start = np.where(ends_there, stop - length, start)
    inside = (start[:, None] <= cells) & (cells < stop[:, None])
    level = _levels(rng, (count, 1), at_bounds=kind < _TO_BOUND)
    stepped = np.clip(values + _steps(rng, (count, 1)), 0.0, 1.0)
    stretched = np.where(inside, np.where(kind < _TO_LEVEL, level, stepped), values)
    shift = rng.integers(-reach, reach + 1, (count, 1))
    shifted = np.take_along_axis(values, (cells - shift) % size, axis=1)
    moved = _switch_moved(values, np.asarray(rng.integers(1, reach + 1, count)), rng)
    return np.where(kind < _STEPPED, stretched, np.where(kind < _SWITCH_MOVED, moved, shifted))


def _switch_moved(values: Array, shift: NDArray[np.int64], rng: np.random.Generator) -> Array:
    """Return held signals, each with one switch moved to an earlier or a later cell."""
    count, size = values.shape
    if size < 2:
        return values
    switches = values[:, 1:] != values[:, :-1]
    at = 1 + np.argmax(switches * rng.random(switches.shape), axis=1)
    rows, earlier = np.arange(count), rng.random(count) < 0.5
    start, stop = np.where(earlier, at - shift, at), np.where(earlier, at, at + shift)
    level = np.where(earlier, values[rows, at], values[rows, at - 1])
    cells = np.arange(size)
    return np.where((start[:, None] <= cells) & (cells < stop[:, None]), level[:, None], values)


def _changed_control_points(values: Array, own: Bools, rng: np.random.Generator) -> Array:
    """Return points, shape (m, d), with some of the ``own`` control points changed, at least one a row."""
    count, size = values.shape
    moves = rng.random((count, size)) < np.where(rng.random((count, 1)) < 0.5, 0.2, 0.5)
    moves[np.arange(count), np.argmax(own * rng.random((count, size)), axis=1)] = True
    moves &= own
    kind = rng.random((count, size))
    stepped = np.clip(values + _steps(rng, (count, size)), 0.0, 1.0)
    level = _levels(rng, (count, size), at_bounds=kind < _POINT_TO_BOUND)
    is_step = (kind >= _POINT_TO_BOUND) & (kind < _POINT_STEPPED)
    return np.where(moves, np.where(is_step, stepped, level), values)


def _steps(rng: np.random.Generator, shape: tuple[int, int]) -> Array:
    return rng.choice(_STEPS, shape) * rng.standard_normal(shape)
