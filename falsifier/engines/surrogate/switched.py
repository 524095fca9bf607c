"""Dynamics of systems with modes: smooth ones in each mode, and surfaces at which modes change.

A mode is what all discrete states are together, such as a gear, or a state of a controller. Smooth dynamics
that predict discrete states as if they were continuous blur the times at which these change, and on these
times alone the robustness over discrete signals depends.
"""

from collections.abc import Sequence
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array
from falsifier.engines.surrogate.dynamics import Prediction, Traces, ridge, seen_range
from falsifier.engines.surrogate.settings import Settings

# More modes than this have too few examples each.
_MOST_MODES = 16
# Highest degree of the products of states and inputs; fewer if there would be too many products.
_DEGREE = 3
# Penalty on the weights of a surface, small because the changes of a deterministic system can be separated.
_PENALTY = 1e-5
_NEWTON_STEPS = 15
_RIDGE = 1e-6

Ints = NDArray[np.intp]


class SwitchedDynamics:
    """Increments are polynomials of state and input in each mode; so are the surfaces at which it changes.

    The surface between a mode and one that followed it is found by logistic regression: what the state and
    the input were in the cells at whose end the mode changed, and in all others.
    """

    def __init__(
        self, traces: Traces, best: Sequence[int], settings: Settings, rng: np.random.Generator
    ) -> None:
        states, inputs = traces.states, traces.inputs
        self._discrete = discrete_states(states)
        smooth = states[:, :, ~self._discrete]
        self._levels, modes = _modes(states[:, :, self._discrete])
        x = np.concatenate([smooth[:, :-1], inputs], axis=2).reshape(-1, smooth.shape[2] + inputs.shape[2])
        target = np.concatenate([np.diff(smooth, axis=1), traces.excess], axis=2).reshape(len(x), -1)
        now, after = modes[:, :-1].ravel(), modes[:, 1:].ravel()
        rows, weights = _drawn(now != after, 2 * settings.most_rows, rng)
        important = np.ones(inputs.shape[:2])
        important[list(best)] += settings.best_weight
        x, target, now, after = x[rows], target[rows], now[rows], after[rows]
        self._mean, self._unit = x.mean(axis=0), x.std(axis=0) + 1e-3 * np.abs(x).max(axis=0) + 1e-9
        self._factors = _products(x.shape[1], settings.features)
        z = _multiplied((x - self._mean) / self._unit, self._factors)
        self._steps = np.zeros((len(self._levels), z.shape[1], target.shape[1]))
        surfaces: list[Array] = []
        followers: list[int] = []
        ends: list[int] = []
        for mode in range(len(self._levels)):
            stays = (now == mode) & (after == mode)
            if stays.any():
                weight = weights[stays] * important.ravel()[rows][stays]
                self._steps[mode] = ridge(z[stays], target[stays], weight, _RIDGE)
            here = now == mode
            for other in np.unique(after[here & ~stays]):
                surfaces.append(_surface(z[here], after[here] == other, weights[here]))
                followers.append(int(other))
            ends.append(len(followers))
        self._surfaces = np.array(surfaces).reshape(-1, z.shape[1])
        self._ends, self._followers = np.array(ends, dtype=np.intp), np.array(followers, dtype=np.intp)
        self._low, self._high = (bound.astype(np.float64) for bound in seen_range(smooth))

    def predict(self, inputs: Array, start: Array) -> Prediction:
        """Predict m traces; arguments as in ``Dynamics.predict``."""
        from falsifier.engines.surrogate.kernels import roll_out_modes

        count, cells, _ = inputs.shape
        smooth = np.empty((count, cells + 1, int((~self._discrete).sum())))
        smooth[:, 0] = start[:, ~self._discrete]
        modes = np.empty((count, cells + 1), np.intp)
        distances = np.abs(start[:, None, self._discrete] - self._levels[None]).sum(axis=2)
        modes[:, 0] = distances.argmin(axis=1)
        excess = np.empty((count, cells, self._steps.shape[2] - smooth.shape[2]))
        roll_out_modes(
            self._factors,
            self._mean,
            self._unit,
            self._steps,
            self._surfaces,
            self._ends,
            self._followers,
            self._low,
            self._high,
            np.ascontiguousarray(inputs),
            modes,
            smooth,
            excess,
        )
        states = np.empty((count, cells + 1, len(self._discrete)))
        states[:, :, ~self._discrete] = smooth
        states[:, :, self._discrete] = self._levels[modes]
        return Prediction(states, excess)


def discrete_states(states: Array) -> NDArray[np.bool_]:
    """Return which states, of traces of shape (m, cells + 1, n), are discrete: integers that change."""
    varies = np.ptp(states, axis=(0, 1)) > 0
    return np.asarray(varies & (states == np.rint(states)).all(axis=(0, 1)))


def has_modes(states: Array) -> bool:
    """Whether traces, shape (m, cells + 1, n), have modes that change, and few enough to learn each."""
    values = states[:, :, discrete_states(states)]
    changes = np.diff(values, axis=1).any(axis=2)
    # Each mode is at a start or after a change; to compare all points with each other would take long.
    entered = np.concatenate([values[:, 0], values[:, 1:][changes]])
    return bool(changes.any()) and len(np.unique(entered, axis=0)) <= _MOST_MODES


def _modes(values: Array) -> tuple[Array, Ints]:
    """Return the modes' discrete states, shape (modes, k), and each point's mode, for values (m, n, k)."""
    levels, which = np.unique(values.reshape(-1, values.shape[2]), axis=0, return_inverse=True)
    return levels, which.reshape(values.shape[:2]).astype(np.intp)


def _products(width: int, most: int) -> Ints:
    """Return the factors of all products up to the highest degree with at most ``most``, shape (p, degree).

    A factor that equals the width stands for one, so that the products include lower degrees.
    """
    for degree in range(_DEGREE, 1, -1):
        found = list(combinations_with_replacement(range(width + 1), degree))
        if len(found) <= most:
            return np.array(found, dtype=np.intp)
    return np.arange(width + 1, dtype=np.intp)[:, None]


def _multiplied(z: Array, factors: Ints) -> Array:
    """Return the products, shape (rows, p), of scaled states and inputs, shape (rows, width)."""
    columns = np.concatenate([z, np.ones((len(z), 1))], axis=1).T
    return np.ascontiguousarray(np.prod(columns[factors], axis=1).T)


def _drawn(changes: NDArray[np.bool_], most: int, rng: np.random.Generator) -> tuple[Ints, Array]:
    """Draw rows of a regression, at most so many in which the mode changes and so many in which it does not.

    Returns:
        Indices of the rows, and how many rows each stands for.
    """
    rows, weights = [], []
    for group in (np.flatnonzero(changes), np.flatnonzero(~changes)):
        some = group if len(group) <= most else np.sort(rng.choice(group, most, replace=False))
        rows.append(some)
        weights.append(np.full(len(some), len(group) / max(1, len(some))))
    return np.concatenate(rows), np.concatenate(weights)


def _surface(z: Array, changes: NDArray[np.bool_], weights: Array) -> Array:
    """Return weights of products, shape (p,), whose sum is positive where the mode changes.

    Args:
        z: products in cells that begin in the mode, shape (rows, p); the last one is 1.
        changes: whether the mode changes in a cell, shape (rows,); for at least one it does.
        weights: how many cells each row stands for, shape (rows,).
    """
    # Changes are rare; both kinds of cells count the same.
    known, other = weights @ changes, max(float(weights @ ~changes), 1.0)
    share, result = weights * np.where(changes, 0.5 / known, 0.5 / other), np.zeros(z.shape[1])
    for _ in range(_NEWTON_STEPS):
        chance = 1.0 / (1.0 + np.exp(-np.clip(z @ result, -30.0, 30.0)))
        gradient = z.T @ (share * (chance - changes)) + _PENALTY * result
        curvature = (z.T * (share * chance * (1.0 - chance))) @ z + _PENALTY * np.eye(len(result))
        step = np.linalg.solve(curvature, gradient)
        result -= step
        if np.abs(step).max() < 1e-4:
            break
    # The sum is made positive in as many cells as change.
    scores = z @ result
    order = np.argsort(-scores, kind="stable")
    last = min(int(np.searchsorted(np.cumsum(weights[order]), known - 1e-9)), len(order) - 1)
    following = min(last + 1, len(order) - 1)
    result[-1] -= 0.5 * (scores[order[last]] + scores[order[following]])
    return result
