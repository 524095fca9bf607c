"""Optimisation on predicted trajectories: evolution, then steps towards bounds along the gradient.

Where the robustness shows no way down, an output is driven further than any simulation has. A limiter, a mode
or a counter often depends on a signal that the requirement does not name: as long as the signal stays within
its usual range, the robustness stays the same.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.layout import Array, Layout
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.variation import mutations, random_points

# Two points that differ by less than this in every coordinate count as the same simulation.
_SAME_POINT = 1e-3
# Number of plans that drive an output one way without anything new happening, after which it is left alone.
_MOST_TRIES = 3
# Survivors of each generation.
_PARENTS = 30
# Number of inputs, parameters and outputs up to which a plan has all candidates; with more, in the same time.
_MOST_SIGNALS = 8
# Number of blocks of coordinates by which a gradient is taken; more take longer.
_DIRECTIONS = 60


def plan(
    predict: Callable[[Array], Array],
    layout: Layout,
    elites: Array,
    critical: Array,
    *,
    seen: Array,
    outputs: int,
    settings: Settings,
    rng: np.random.Generator,
) -> Array:
    """Return the most promising point that has not been simulated yet, or one that has if none else is found.

    ``predict`` returns the predicted costs of points from a number of ``outputs``. ``elites`` are the best
    simulated points, shape (e, d), ``critical`` their critical times as shares of the horizon, shape (e,),
    and ``seen`` all simulated or pending points, shape (s, d).
    """
    share = min(1.0, _MOST_SIGNALS / (outputs + len(layout.groups)))
    first, later = (max(round(share * n), _PARENTS) for n in (settings.pool, settings.pool / 2))
    bred = first // 3
    children = np.concatenate(
        [
            random_points(layout, rng, first - bred),
            elites,
            mutations(layout, rng, elites, bred, critical=critical),
        ]
    )
    pool, costs = _best(layout, children, predict(children))
    blocks = _blocks(layout)
    for step in range(settings.generations + settings.bound_steps):
        if step < settings.generations:
            children = mutations(layout, rng, pool, later)
        else:
            base = pool[0 if (step - settings.generations) % 2 == 0 else rng.integers(min(5, len(pool)))]
            children = layout.settled(_towards_bounds(predict, base, blocks))
        found = np.concatenate([costs, predict(children)])
        pool, costs = _best(layout, np.concatenate([pool, children]), found)
    # The additional points are used only if the whole pool has been simulated before.
    others = [mutations(layout, rng, pool, len(pool)), random_points(layout, rng, len(pool))]
    points = np.concatenate([pool, *others])
    return np.asarray(next((point for point in points if not is_seen(point, seen)), points[0]))


def _best(layout: Layout, points: Array, costs: Array) -> tuple[Array, Array]:
    """Return the points with the lowest costs; where different draws are often equal, each point once."""
    if layout.has_gaps:
        _, firsts = np.unique(points, axis=0, return_index=True)
        firsts.sort()
        points, costs = points[firsts], costs[firsts]
    order = np.argsort(costs, kind="stable")[:_PARENTS]
    return points[order], costs[order]


def _blocks(layout: Layout) -> NDArray[np.intp]:
    """Return for each coordinate the number of its block of neighbours in one group."""
    width = -(-layout.dimension // _DIRECTIONS)
    sizes = [-(-len(group) // width) for group in layout.groups]
    firsts = np.cumsum([0, *sizes[:-1]])
    parts = [f + np.arange(len(g)) // width for f, g in zip(firsts, layout.groups, strict=True)]
    return np.concatenate(parts)


def _towards_bounds(predict: Callable[[Array], Array], base: Array, blocks: NDArray[np.intp]) -> Array:
    """Return points between the base and the corner to which the negative gradient points.

    The gradient is taken by blocks of coordinates, as neighbouring cells of an input do nearly the same.
    """
    count = int(blocks[-1]) + 1
    step = np.where(np.bincount(blocks, base) / np.bincount(blocks) > 0.5, -0.05, 0.05)
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


@dataclass(frozen=True, slots=True)
class Push:
    """An output and the direction in which it is driven."""

    output: str  # name of the output
    column: int  # its column in the states of traces
    sign: int  # 1: up, -1: down

    def heights(self, states: Array) -> Array:
        """Return how far the output went at each time, shape (..., cells + 1), in states with columns."""
        return np.asarray(self.sign * states[..., self.column])

    def __str__(self) -> str:
        """Return what a plan does, in words."""
        return f"drives {self.output} further {'up' if self.sign > 0 else 'down'}"


@dataclass(slots=True)
class Pushes:
    """Which outputs were driven which way, and how often since that last brought something new."""

    _tries: dict[Push, int] = field(default_factory=dict)

    def know(self, outputs: Sequence[str], continuous: Sequence[str]) -> None:
        """Add the outputs, of all that are predicted, that are continuous."""
        for name in continuous:
            for sign in (1, -1):
                self._tries.setdefault(Push(name, outputs.index(name), sign), 0)

    @property
    def is_done(self) -> bool:
        """Whether nothing is left that is worth trying."""
        return min(self._tries.values(), default=_MOST_TRIES) >= _MOST_TRIES

    def next(self, rng: np.random.Generator) -> Push:
        """Return the one that was tried the least, and count it."""
        push = min(self._tries, key=lambda p: (self._tries[p], rng.random()))
        self._tries[push] += 1
        return push

    def succeeded(self, push: Push) -> None:
        """Note that it made a discrete signal do something new: that try does not count."""
        self._tries[push] -= 1
