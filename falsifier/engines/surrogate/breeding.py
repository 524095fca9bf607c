"""Compiled draws and changes of points: a plan needs thousands.

All change their first array in place. Importing this module imports numba.
"""

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array
from falsifier.engines.numba_compilation import compiled

# Cumulative probabilities of the changes of held cells: a bound, any level, a small step, a switch moved
# in time; the rest shifts the whole signal.
_TO_BOUND, _TO_LEVEL, _STEPPED, _SWITCH_MOVED = 0.35, 0.5, 0.65, 0.85
# The same for control points: a bound, a small step; the rest to any level.
_POINT_TO_BOUND, _POINT_STEPPED = 0.1, 0.95
# Maximum shift in time, as a share of the horizon.
_REACH = 0.05

Ints = NDArray[np.intp]
Bools = NDArray[np.bool_]


@compiled
def draw(points: Array, ends: Ints, is_fine: Bools, rng: np.random.Generator) -> None:
    """Draw points: with few or many pieces, at bounds or in between.

    Args:
        points: shape (m, d), to be filled in.
        ends: end of each group of coordinates, shape (groups,).
        is_fine: whether a group consists of many held cells, shape (groups,).
        rng: random generator.
    """
    for row in range(len(points)):
        start = 0
        for group in range(len(ends)):
            if is_fine[group]:
                _draw_pieces(points[row, start : ends[group]], rng)
            else:
                _draw_levels(points[row, start : ends[group]], rng)
            start = ends[group]


@compiled
def _draw_pieces(values: Array, rng: np.random.Generator) -> None:
    """Draw a held signal; each order of magnitude of the number of its pieces is equally likely."""
    size = len(values)
    pieces = min(max(int(np.exp(rng.random() * np.log(size + 1))), 1), size)
    at_bounds = rng.random() < 0.6
    level = 0.0
    for i in range(size):
        # The first cell starts a piece; of the others, each is equally likely to start one of the rest.
        if rng.random() * (size - i) < pieces or i == 0:
            level = np.rint(rng.random()) if at_bounds else rng.random()
            pieces -= 1
        values[i] = level


@compiled
def _draw_levels(values: Array, rng: np.random.Generator) -> None:
    """Draw control points: at bounds or anywhere, equal to the one before or not."""
    at_bounds, stays = rng.random() < 0.5, 0.9 * rng.random()
    for i in range(len(values)):
        if i and rng.random() < stays:
            values[i] = values[i - 1]
        else:
            values[i] = np.rint(rng.random()) if at_bounds else rng.random()


@compiled
def cross(
    children: Array, parents: Array, ends: Ints, inputs: int, share: float, rng: np.random.Generator
) -> None:
    """Replace the signals of a share of children with another parent's from a random time on.

    Args:
        children: shape (m, d).
        parents: shape (p, d).
        ends: end of each group of coordinates, shape (groups,).
        inputs: number of groups that are inputs; the others are parameters, replaced at random.
        share: probability that a child is changed.
        rng: random generator.
    """
    for row in range(len(children)):
        if rng.random() >= share:
            continue
        other = parents[int(rng.random() * len(parents))]
        time, start = rng.random(), 0
        for group in range(len(ends)):
            size = ends[group] - start
            kept = int(time * size) if group < inputs else size * int(rng.random() * 2)
            for i in range(start + kept, ends[group]):
                children[row, i] = other[i]
            start = ends[group]


@compiled
def change(children: Array, until: Array, ends: Ints, is_fine: Bools, rng: np.random.Generator) -> None:
    """Change one to three times one group of each child.

    Args:
        children: shape (m, d).
        until: share of the horizon at which half of the changes of held cells end, or NaN, shape (m,).
        ends: end of each group of coordinates, shape (groups,).
        is_fine: whether a group consists of many held cells, shape (groups,).
        rng: random generator.
    """
    for row in range(len(children)):
        for _ in range(1 + int(3 * rng.random())):
            group = int(rng.random() * len(ends))
            values = children[row, ends[group - 1] if group else 0 : ends[group]]
            if is_fine[group]:
                _change_pieces(values, until[row], rng)
            else:
                _change_points(values, rng)


@compiled
def _change_pieces(values: Array, until: float, rng: np.random.Generator) -> None:
    """Change a held signal in one way."""
    size, kind = len(values), rng.random()
    reach = max(1, int(_REACH * size))
    if kind >= _SWITCH_MOVED:
        shift, before = int(rng.random() * (2 * reach + 1)) - reach, values.copy()
        for i in range(size):
            values[i] = before[(i - shift) % size]
        return
    if kind >= _STEPPED:
        _move_switch(values, 1 + int(reach * rng.random()), rng)
        return
    # A stretch of any order of magnitude.
    length = max(1, int(np.exp(rng.random() * np.log(size))))
    start = int(size * rng.random())
    stop = min(size, start + length)
    if not np.isnan(until) and rng.random() < 0.5:
        stop = min(size, int(until * size + 1))
        start = max(0, stop - length)
    level = np.rint(rng.random()) if kind < _TO_BOUND else rng.random()
    step = _step(rng)
    for i in range(start, stop):
        values[i] = level if kind < _TO_LEVEL else min(max(values[i] + step, 0.0), 1.0)


@compiled
def _move_switch(values: Array, shift: int, rng: np.random.Generator) -> None:
    """Move one switch of a held signal to an earlier or a later cell."""
    size, at, seen = len(values), 0, 0
    for i in range(1, size):
        if values[i] != values[i - 1]:
            seen += 1
            # In the end, each switch is equally likely to be this one.
            if rng.random() * seen < 1.0:
                at = i
    if at == 0:
        return
    before, after, earlier = values[at - 1], values[at], rng.random() < 0.5
    start, stop = (max(0, at - shift), at) if earlier else (at, min(size, at + shift))
    for i in range(start, stop):
        values[i] = after if earlier else before


@compiled
def _change_points(values: Array, rng: np.random.Generator) -> None:
    """Change some control points, at least one."""
    size = len(values)
    share = 0.2 if rng.random() < 0.5 else 0.5
    certain = int(size * rng.random())
    for i in range(size):
        if i != certain and rng.random() >= share:
            continue
        kind = rng.random()
        if kind < _POINT_TO_BOUND:
            values[i] = np.rint(rng.random())
        elif kind < _POINT_STEPPED:
            values[i] = min(max(values[i] + _step(rng), 0.0), 1.0)
        else:
            values[i] = rng.random()


@compiled
def _step(rng: np.random.Generator) -> float:
    """Draw a small change: its standard deviation is coarse, medium or fine, equally likely."""
    kind = rng.random()
    spread = 0.3 if kind < 1 / 3 else 0.1 if kind < 2 / 3 else 0.03
    # Box and Muller's normal numbers: numba's take seconds to compile.
    return float(spread * np.sqrt(-2.0 * np.log(1.0 - rng.random())) * np.cos(2.0 * np.pi * rng.random()))
