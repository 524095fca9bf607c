"""Search without dynamics: changes of the best inputs."""

from collections.abc import Callable

import numpy as np

from falsifier.engines.layout import Array, Layout
from falsifier.engines.surrogate.variation import changed, held_from, paced

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
    fresh = np.array([paced(layout, rng) for _ in range(draws)])
    return fresh[np.argmin(risk(fresh))], "random: a new start of the search by changes"


def _changes(layout: Layout, points: Array, costs: Array, decided: Array, rng: np.random.Generator) -> Array:
    """Return changes of good points that can matter, shape (m, d); m may be 0."""
    # Among equal costs, any order: the first one would else be changed for ever.
    order = np.lexsort((rng.random(len(costs)), costs))
    chosen = order[np.minimum(rng.exponential(_MEAN_RANK, _TRIES).astype(np.intp), len(order) - 1)]
    parents, decided = points[chosen], decided[chosen]
    children = changed(layout, rng, parents)
    held = rng.random(_TRIES) < _HELD
    children[held] = held_from(layout, rng, parents[held], decided[held])
    early = layout.starts[None] <= decided[:, None]
    return np.asarray(children[((np.abs(children - parents) > _TOLERANCE) & early).any(axis=1)])
