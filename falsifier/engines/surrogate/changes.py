"""Changes of the best inputs, without dynamics."""

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
# Number of simulations before their changes are tried; share of random points later.
_FIRST, _FRESH = 8, 0.05
# Maximum number of pieces of a random point.
_PIECES = 6
# Share of changes that keep all inputs constant from some time on: an excited system that is left alone may
# do by itself what constant disturbance hides.
_HELD = 0.2
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


def propose_change(
    seen: Seen,
    layout: Layout,
    settings: Settings,
    rng: np.random.Generator,
    risk: Callable[[Array], Array] | None = None,
) -> tuple[Array, str]:
    """Return a change of one of the best points, or a random point, and what it is.

    What comes after the time that decided a cost cannot lower it, so such changes are not proposed.

    Args:
        seen: what was simulated.
        layout: layout of the points.
        settings: settings of the engine.
        rng: random generator.
        risk: returns from 0 to 1 how likely the simulations of points fail, shape (m,); None: none fails.
    """
    if len(seen.costs) >= _FIRST and rng.random() >= _FRESH:
        children = _changes(seen, layout, settings, rng)
        if len(children):
            return _least_risky(children, risk), "a change of one of the best candidates"
    count = max(settings.retries, 1) if risk else 1
    fresh = [paced(layout, rng, _PIECES, settings.at_bounds) for _ in range(count)]
    return _least_risky(np.array(fresh), risk), "random: a new start of the search by changes"


def _changes(seen: Seen, layout: Layout, settings: Settings, rng: np.random.Generator) -> Array:
    """Return changes of good points that can matter, shape (m, d); m may be 0."""
    # Among equal costs, any order: the first one would else be changed for ever.
    order = np.lexsort((rng.random(len(seen.costs)), seen.costs))
    chosen = order[np.minimum(rng.exponential(_MEAN_RANK, _TRIES).astype(np.intp), len(order) - 1)]
    parents, decided = seen.points[chosen], seen.decided[chosen]
    children = changed(layout, rng, parents)
    held = rng.random(_TRIES) < _HELD
    children[held] = held_from(layout, rng, parents[held], decided[held], settings.at_bounds)
    early = layout.starts[None] <= decided[:, None]
    matters = ((np.abs(children - parents) > _TOLERANCE) & early).any(axis=1)
    return np.asarray(children[matters])


def _least_risky(points: Array, risk: Callable[[Array], Array] | None) -> Array:
    """Return the first of the points whose simulations are the least likely to fail."""
    return np.asarray(points[0 if risk is None else int(np.argmin(risk(points)))])
