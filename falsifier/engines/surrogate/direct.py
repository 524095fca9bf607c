"""Search without dynamics: changes of the best inputs."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.layout import Layout
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.variation import changed, random_points

# Changes that are drawn for one proposal; the first that matters is taken.
_TRIES = 100
# Mean rank, from 0, of the point that is changed.
_MEAN_RANK = 1.0
_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What was simulated.

    Attributes:
        points: shape (n, d).
        costs: shape (n,).
        decided: time in s by which the inputs had decided each cost, shape (n,).
    """

    points: Array
    costs: Array
    decided: Array


def propose(
    seen: Seen,
    layout: Layout,
    settings: Settings,
    rng: np.random.Generator,
    risk: Callable[[Array], Array] | None = None,
) -> Array:
    """Return a change of one of the best points of the current round, or a random point, shape (d,).

    What comes after the time that decided a cost cannot lower it, so such changes are not proposed.

    Args:
        seen: what was simulated.
        layout: layout of the points.
        settings: settings of the engine.
        rng: random generator.
        risk: returns from 0 to 1 how likely the simulations of points fail, shape (m,); None: none fails.
    """
    start = round_start(seen.costs, settings.direct_patience)
    if len(seen.costs) - start < settings.direct_start or rng.random() < settings.direct_fresh:
        return _least_risky(random_points(layout, rng, max(settings.retries, 1)), risk)
    order = start + np.argsort(seen.costs[start:], kind="stable")[: settings.direct_parents]
    rank = rng.exponential(_MEAN_RANK, _TRIES).astype(np.intp)
    chosen = order[np.minimum(rank, len(order) - 1)]
    parents = seen.points[chosen]
    children = changed(layout, rng, parents)
    early = layout.starts[None] < seen.decided[chosen, None]
    matters = ((np.abs(children - parents) > _TOLERANCE) & early).any(axis=1)
    return _least_risky(children[matters] if matters.any() else children, risk)


def round_start(costs: Array, patience: int) -> int:
    """Return the index of the first simulation of the current round.

    A round ends after as many simulations as the patience that did not improve its best cost: changes of its
    good points lead nowhere then, and other points are needed.
    """
    start = best = 0
    for i, cost in enumerate(costs):
        if i == start or cost < costs[best]:
            best = i
        elif i - best >= patience:
            start = i + 1
    return start


def _least_risky(points: Array, risk: Callable[[Array], Array] | None) -> Array:
    """Return the first of the points whose simulations are the least likely to fail."""
    return np.asarray(points[0 if risk is None else int(np.argmin(risk(points)))])
