"""Optimisation on predicted traces: evolution, gradient steps towards bounds, preference for extremes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array
from falsifier.engines.layout import Layout
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.variation import mutations, random_points

# Two points that differ by less than this in every coordinate count as the same simulation.
_SAME_POINT = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A point with its predicted scaled robustness.

    Attributes:
        point: the point in [0, 1]^d.
        cost: predicted scaled robustness.
        is_simple: whether it was preferred because it is extreme.
    """

    point: Array
    cost: float
    is_simple: bool


def plan(
    predict: Callable[[Array], Array],
    layout: Layout,
    *,
    elites: Array,
    critical: Array,
    seen: Array,
    settings: Settings,
    snap: float,
    rng: np.random.Generator,
) -> Plan:
    """Return the most promising point that has not been simulated yet, or one that has if none else is found.

    Args:
        predict: returns the predicted costs of points.
        layout: layout of the points.
        elites: best simulated points, shape (e, d).
        critical: their critical times as shares of the horizon, shape (e,).
        seen: all simulated or pending points, shape (s, d).
        settings: sizes of the populations.
        snap: maximum difference of predicted cost up to which a simple point is preferred to the best one.
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
    for _ in range(settings.generations - 1):
        children = mutations(layout, rng, pool, settings.children)
        pool, costs = _best(
            layout,
            np.concatenate([pool, children]),
            np.concatenate([costs, predict(children)]),
            settings.parents,
        )
    blocks = _blocks(layout, settings.directions)
    for step in range(settings.vertex_steps):
        base = pool[0] if step % 2 == 0 else pool[rng.integers(min(5, len(pool)))]
        towards = layout.settled(_towards_bounds(predict, base, blocks))
        pool, costs = _best(
            layout,
            np.concatenate([pool, towards]),
            np.concatenate([costs, predict(towards)]),
            settings.parents,
        )
    simple = np.array([p for p in _simple_points(layout, pool) if not is_seen(p, seen)])
    if len(simple):
        simple_costs = predict(simple)
        best = int(np.argmin(simple_costs))
        if simple_costs[best] <= costs[0] + snap:
            return Plan(simple[best], float(simple_costs[best]), is_simple=True)
    # The additional points are used only if the whole pool has been simulated before.
    others = [mutations(layout, rng, pool, len(pool)), random_points(layout, rng, len(pool))]
    points = np.concatenate([pool, *others])
    unseen = next((i for i, point in enumerate(points) if not is_seen(point, seen)), 0)
    cost = costs[unseen] if unseen < len(costs) else predict(points[unseen][None])[0]
    return Plan(points[unseen], float(cost), is_simple=False)


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


def _simple_points(layout: Layout, pool: Array) -> Iterator[Array]:
    """Yield variants of the best points in which all inputs are at bounds and nearly constant."""
    if len(layout.groups) <= 4:
        choices: Sequence[tuple[float | None, ...]] = list(
            product((None, 0.0, 1.0), repeat=len(layout.groups))
        )
        for levels in choices:
            for base in pool[:3]:
                point = base.copy()
                for group, level in zip(layout.groups, levels, strict=True):
                    if level is not None:
                        point[group] = level
                point = layout.settled(point)
                if _is_at_bounds(layout, point):
                    yield point
    for base in pool[:5]:
        point = layout.settled(np.round(base))
        if _is_at_bounds(layout, point):
            yield point


def _is_at_bounds(layout: Layout, point: Array) -> bool:
    """Whether nearly all coordinates (99 %) are at a bound and equal to their neighbours."""
    extreme = np.mean((point == 0.0) | (point == 1.0))
    changing = np.mean([np.mean(np.diff(point[g]) != 0) if len(g) > 1 else 0.0 for g in layout.groups])
    return bool(extreme - changing > 0.99)


def is_seen(point: Array, seen: Array) -> bool:
    """Whether a point, shape (d,), is the same simulation as one of others, shape (s, d)."""
    return bool(len(seen)) and bool((np.abs(seen - point).max(axis=1) < _SAME_POINT).any())
