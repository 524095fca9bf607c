"""Search without dynamics: changes of the best inputs."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.layout import Layout
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.variation import changed, held_from, paced

# Changes that are drawn for one proposal; the first that matters is taken.
_TRIES = 100
# Mean rank, from 0, of the point that is changed.
_MEAN_RANK = 0.5
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


@dataclass(frozen=True, slots=True, eq=False)
class Draw:
    """A proposal.

    Attributes:
        point: shape (d,).
        why: what it is.
    """

    point: Array
    why: str


def propose(
    seen: Seen,
    layout: Layout,
    settings: Settings,
    rng: np.random.Generator,
    risk: Callable[[Array], Array] | None = None,
) -> Draw:
    """Return a change of one of the best points of the current round, or a random point.

    What comes after the time that decided a cost cannot lower it, so such changes are not proposed.

    Args:
        seen: what was simulated.
        layout: layout of the points.
        settings: settings of the engine.
        rng: random generator.
        risk: returns from 0 to 1 how likely the simulations of points fail, shape (m,); None: none fails.
    """
    start = round_start(seen.costs, settings.direct_patience)
    if len(seen.costs) - start >= settings.direct_start and rng.random() >= settings.direct_fresh:
        children = _changes(seen, start, layout, settings, rng)
        if len(children):
            return Draw(_least_risky(children, risk), "a change of one of the best candidates")
    fresh = [
        paced(layout, rng, settings.direct_pieces, settings.direct_at_bounds)
        for _ in range(max(settings.retries, 1) if risk else 1)
    ]
    return Draw(_least_risky(np.array(fresh), risk), "random: a new start of the search by changes")


def _changes(seen: Seen, start: int, layout: Layout, settings: Settings, rng: np.random.Generator) -> Array:
    """Return changes of good points of a round that can matter, shape (m, d); m may be 0."""
    order = start + np.argsort(seen.costs[start:], kind="stable")[: settings.direct_parents]
    rank = rng.exponential(_MEAN_RANK, _TRIES).astype(np.intp)
    chosen = order[np.minimum(rank, len(order) - 1)]
    parents, decided = seen.points[chosen], seen.decided[chosen]
    children = changed(layout, rng, parents)
    held = rng.random(_TRIES) < settings.direct_held
    children[held] = held_from(layout, rng, parents[held], decided[held], settings.direct_at_bounds)
    early = layout.starts[None] <= decided[:, None]
    matters = ((np.abs(children - parents) > _TOLERANCE) & early).any(axis=1)
    return np.asarray(children[matters])


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
