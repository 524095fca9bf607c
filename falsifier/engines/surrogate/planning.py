"""Optimisation on predicted trajectories: evolution, then steps towards bounds along the gradient."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array
from falsifier.engines.layout import Layout
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.variation import mutations, random_points

# Two points that differ by less than this in every coordinate count as the same simulation.
_SAME_POINT = 1e-3
# Number of blocks of coordinates by which a gradient is taken; more take longer.
_DIRECTIONS = 60


def plan(
    predict: Callable[[Array], Array],
    layout: Layout,
    *,
    elites: Array,
    critical: Array,
    seen: Array,
    settings: Settings,
    rng: np.random.Generator,
) -> Array:
    """Return the most promising point that has not been simulated yet, or one that has if none else is found.

    Args:
        predict: returns the predicted costs of points.
        layout: layout of the points.
        elites: best simulated points, shape (e, d).
        critical: their critical times as shares of the horizon, shape (e,).
        seen: all simulated or pending points, shape (s, d).
        settings: sizes of the populations.
        rng: random generator.
    """
    bred = settings.pool // 3
    children = np.concatenate(
        [
            random_points(layout, rng, settings.pool - bred),
            elites,
            mutations(layout, rng, elites, bred, critical=critical),
        ]
    )
    pool, costs = _best(layout, children, predict(children), settings.parents)
    blocks = _blocks(layout, _DIRECTIONS)
    for step in range(settings.generations + settings.bound_steps):
        if step < settings.generations:
            children = mutations(layout, rng, pool, settings.children)
        else:
            base = pool[0 if (step - settings.generations) % 2 == 0 else rng.integers(min(5, len(pool)))]
            children = layout.settled(_towards_bounds(predict, base, blocks))
        pool, costs = _best(
            layout,
            np.concatenate([pool, children]),
            np.concatenate([costs, predict(children)]),
            settings.parents,
        )
    # The additional points are used only if the whole pool has been simulated before.
    others = [mutations(layout, rng, pool, len(pool)), random_points(layout, rng, len(pool))]
    points = np.concatenate([pool, *others])
    return np.asarray(next((point for point in points if not is_seen(point, seen)), points[0]))


def _best(layout: Layout, points: Array, costs: Array, count: int) -> tuple[Array, Array]:
    """Return the points with the lowest costs; where different draws are often equal, each point once."""
    if layout.has_gaps:
        _, firsts = np.unique(points, axis=0, return_index=True)
        firsts.sort()
        points, costs = points[firsts], costs[firsts]
    order = np.argsort(costs, kind="stable")[:count]
    return points[order], costs[order]


def _blocks(layout: Layout, most: int) -> NDArray[np.intp]:
    """Return for each coordinate the number of its block: neighbours of one group, about ``most`` blocks."""
    width = -(-layout.dimension // most)
    sizes = [-(-len(group) // width) for group in layout.groups]
    firsts = np.cumsum([0, *sizes[:-1]])
    parts = [f + np.arange(len(g)) // width for f, g in zip(firsts, layout.groups, strict=True)]
    return np.concatenate(parts)


def _towards_bounds(predict: Callable[[Array], Array], base: Array, blocks: NDArray[np.intp]) -> Array:
    """Return points between the base and the corner to which the negative gradient points.

    The gradient is taken by blocks of coordinates, as neighbouring cells of an input do nearly the same.
    """
    count = int(blocks[-1]) + 1
    level = np.bincount(blocks, base) / np.bincount(blocks)
    step = np.where(level > 0.5, -0.05, 0.05)
    changed = np.where(blocks == np.arange(count)[:, None], base + step[:, None], base)
    costs = predict(np.concatenate([base[None], np.clip(changed, 0.0, 1.0)]))
    gradient = ((costs[1:] - costs[0]) / step)[blocks]
    corner = (gradient < 0).astype(np.float64)
    size = np.abs(gradient)
    points = [base + share * (corner - base) for share in (0.1, 0.3, 0.6, 1.0)]
    points += [np.where(size > share * size.max(), corner, base) for share in (0.1, 0.3)]
    return np.array(points)


def is_seen(point: Array, seen: Array) -> bool:
    """Whether a point, shape (d,), is the same simulation as one of others, shape (s, d)."""
    return bool(len(seen)) and bool((np.abs(seen - point).max(axis=1) < _SAME_POINT).any())
