"""Dynamics learnt from whole trajectories: one nonlinear and one linear kind; ``switched`` has a third.

Both predict, cell by cell, the next state and the excess of each leaf's envelope (see ``grid.Trace``) from
the current state and input. The nonlinear dynamics use no earlier states. The linear dynamics predict
deviations from the best trajectory and use a few earlier cells, which accounts for initial transients and
hidden states.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.trace import Trace

# Predicted states are limited to the range of the simulated ones, widened by this share of it on both sides.
_WIDENING = 0.5
# Largest predicted deviation, in units of the spread: an unstable fit must not overflow, and deviations this
# large mean nothing anyway.
_FAR = 30.0


@dataclass(frozen=True, slots=True)
class Prediction:
    """Predicted traces.

    Attributes:
        states: coordinates at the grid points, shape (m, cells + 1, dimension).
        excess: excess of each leaf's envelope, shape (m, cells, leaves).
    """

    states: Array
    excess: Array


@dataclass(frozen=True, slots=True)
class Traces:
    """Simulated traces, stacked: attributes as in ``Trace``, with the traces as the first axis."""

    inputs: Array
    states: Array
    excess: Array

    @classmethod
    def of(cls, traces: Sequence[Trace]) -> "Traces":
        """Stack traces."""
        return cls(
            np.stack([t.inputs for t in traces]),
            np.stack([t.states for t in traces]),
            np.stack([t.excess for t in traces]),
        )


class Dynamics(Protocol):
    """Fitted dynamics."""

    def predict(self, inputs: Array, start: Array) -> Prediction:
        """Predict m traces.

        Args:
            inputs: scaled inputs and parameters, shape (m, cells, inputs).
            start: initial states, shape (m, dimension).
        """
        ...


class StartState:
    """The state at the start as a linear function of the first inputs and the parameters.

    Args:
        first: states at the start, shape (m, n).
        inputs: scaled inputs and parameters in the first cell, shape (m, p).
    """

    def __init__(self, first: Array, inputs: Array) -> None:
        self._mean = first.mean(axis=0)
        self._weights = None
        if np.ptp(first, axis=0).max(initial=0.0) > 1e-9 * max(1.0, float(np.abs(first).max(initial=0.0))):
            self._centre = inputs.mean(axis=0)
            z = inputs - self._centre
            gram = z.T @ z + 1e-6 * np.eye(z.shape[1])
            self._weights = np.linalg.solve(gram, z.T @ (first - self._mean))

    def predict(self, inputs: Array) -> Array:
        """Return the states at the start, shape (m, n), for inputs, shape (m, cells, p)."""
        if self._weights is None:
            return np.repeat(self._mean[None], len(inputs), axis=0)
        return np.asarray(self._mean + (inputs[:, 0] - self._centre) @ self._weights)


class FourierDynamics:
    """Nonlinear dynamics: increments by ridge regression on random Fourier features and linear terms.

    Each fit draws a new length scale and new random weights of the rows (a bootstrap). Successive fits then
    differ in regions that the data do not determine, which amounts to Thompson sampling.
    """

    def __init__(
        self, traces: Traces, best: Sequence[int], settings: Settings, rng: np.random.Generator
    ) -> None:
        states, inputs, excess = traces.states, traces.inputs, traces.excess
        weights = np.ones(inputs.shape[:2])
        weights[list(best)] += settings.best_weight
        rows, weight = _drawn(weights, settings.most_rows, rng)
        x = np.concatenate([states[rows], inputs[rows]], axis=1)
        after = states[rows[0], rows[1] + 1]
        target = np.concatenate([after - states[rows], excess[rows]], axis=1)
        mean, spread = x.mean(axis=0), x.std(axis=0) + 1e-3 * np.abs(x).max(axis=0) + 1e-9
        z = (x - mean) / spread
        width = z.shape[1]
        scale = rng.choice([0.7, 1.0, 2.0, 3.0]) * np.sqrt(width) / 1.5
        frequencies = rng.standard_normal((width, settings.features)) / scale
        phases = rng.uniform(0, 2 * np.pi, settings.features)
        amplitude = np.sqrt(2 / settings.features)
        # Single precision: rounding is far below the ridge.
        phi = np.ones((len(z), settings.features + width + 1), np.float32)
        waves = phi[:, : settings.features]
        np.matmul(z.astype(np.float32), frequencies.astype(np.float32), out=waves)
        waves += phases.astype(np.float32)
        np.cos(waves, out=waves)
        waves *= np.float32(amplitude)
        phi[:, settings.features : -1] = 0.3 * z
        centre, unit = target.mean(axis=0), target.std(axis=0) + 1e-9
        solution = ridge(phi, (target - centre) / unit, weight * rng.exponential(size=len(z)), settings.ridge)
        # For fast rollouts, all scalings are folded into two single-precision matrices.
        solution = solution * unit
        raw = frequencies / spread[:, None]
        linear = solution[settings.features : -1] * 0.3 / spread[:, None]
        to_turns = np.vstack([raw, phases - mean @ raw]) / (2 * np.pi)
        to_steps = np.vstack(
            [solution[: settings.features] * amplitude, linear, solution[-1] + centre - mean @ linear]
        )
        self._to_turns = to_turns.astype(np.float32)
        self._to_steps = np.ascontiguousarray(to_steps.T, dtype=np.float32)
        self._low, self._high = seen_range(states)

    def predict(self, inputs: Array, start: Array) -> Prediction:
        """Predict m traces in single precision; arguments as in ``Dynamics.predict``."""
        from falsifier.engines.surrogate.kernels import roll_out_waves

        count, cells, _ = inputs.shape
        n = start.shape[1]
        states = np.empty((count, cells + 1, n), np.float32)
        excess = np.empty((count, cells, len(self._to_steps) - n), np.float32)
        states[:, 0] = start
        driving = np.ascontiguousarray(inputs, dtype=np.float32)
        roll_out_waves(self._to_turns, self._to_steps, self._low, self._high, driving, states, excess)
        return Prediction(states, excess)


class DeviationDynamics:
    """Linear dynamics of deviations from the best trajectory, with several lags."""

    def __init__(
        self, traces: Traces, best: Sequence[int], settings: Settings, rng: np.random.Generator
    ) -> None:
        states, inputs, excess = traces.states, traces.inputs, traces.excess
        self._base = Trace(inputs[best[0]], states[best[0]], excess[best[0]])
        self._lags = lags = settings.lags
        others = np.arange(len(states)) != best[0]
        self._state_unit = _spread(states[others] - self._base.states) + 1e-12
        self._excess_unit = _spread(excess[others] - self._base.excess) + 1e-12
        # Otherwise an input that has hardly varied so far would become a huge deviation as soon as it does.
        self._input_unit = np.maximum(_spread(inputs[others] - self._base.inputs), 0.05)
        weights = np.repeat(rng.exponential(size=(others.sum(), 1)) + 0.2, inputs.shape[1], axis=1)
        rows, weight = _drawn(weights, settings.most_rows, rng, uniformly=True)
        dy, du = self._deviations(states[others], inputs[others])
        lagged = [_lagged(part, lags)[rows] for part in (dy, du)]
        x = np.concatenate([part.reshape(len(part), -1) for part in lagged], axis=1)
        de = (excess[others] - self._base.excess)[rows] / self._excess_unit
        target = np.concatenate([dy[rows[0], rows[1] + lags], de], axis=1)
        linear = ridge(x, target, weight, settings.linear_ridge).T
        own, driving = np.split(linear, [lags * states.shape[2]], axis=1)
        # Rollouts in single precision: rounding is far below what the dynamics do not know.
        self._own, self._driving = (
            np.ascontiguousarray(part.reshape(len(linear), lags, -1), dtype=np.float32)
            for part in (own, driving)
        )
        self._low, self._high = seen_range(states)

    def _deviations(self, states: Array, inputs: Array) -> tuple[Array, Array]:
        """Return deviations in units of their spread, preceded by zeros for the lags."""
        before = self._lags - 1
        dy, du = (
            np.concatenate([np.zeros((len(part), before, part.shape[2])), part], axis=1)
            for part in (
                (states - self._base.states[: states.shape[1]]) / self._state_unit,
                (inputs - self._base.inputs[: inputs.shape[1]]) / self._input_unit,
            )
        )
        return dy, du

    def predict(self, inputs: Array, start: Array) -> Prediction:
        """Predict m traces as deviations; arguments as in ``Dynamics.predict``."""
        from falsifier.engines.surrogate.kernels import roll_out_deviations

        count, cells, _ = inputs.shape
        n = start.shape[1]
        first, du = self._deviations(start[:, None], inputs)
        driving = np.ascontiguousarray(du.transpose(1, 2, 0), dtype=np.float32)
        dy = np.empty((self._lags + cells, n, count), np.float32)
        dy[: self._lags] = first.transpose(1, 2, 0)
        excess = np.empty((cells, len(self._own) - n, count), np.float32)
        roll_out_deviations(self._own, self._driving, _FAR, driving, dy, excess)
        states = _undone(dy[self._lags - 1 :], self._base.states[: cells + 1], self._state_unit)
        return Prediction(
            np.clip(states, self._low, self._high),
            _undone(excess, self._base.excess[:cells], self._excess_unit),
        )


def _undone(deviations: Array, base: Array, unit: Array) -> Array:
    """Return m traces, shape (m, cells, n), from deviations, shape (cells, n, m), in their precision."""
    precision = deviations.dtype
    traces = deviations * unit.astype(precision)[:, None] + base.astype(precision)[:, :, None]
    return np.ascontiguousarray(traces.transpose(2, 0, 1))


def _lagged(values: Array, lags: int) -> Array:
    """Return for each trace and cell the values of ``lags`` cells from there, shape (m, cells, lags, n)."""
    return np.lib.stride_tricks.sliding_window_view(values, lags, axis=1).swapaxes(2, 3)


def _drawn(
    weights: Array, count: int, rng: np.random.Generator, *, uniformly: bool = False
) -> tuple[tuple[NDArray[np.intp], NDArray[np.intp]], Array]:
    """Draw rows of a regression, without repetition; return their traces and cells, and their weights.

    If there are more than ``count`` rows, the weights decide which are drawn and count no more, unless they
    are drawn uniformly.
    """
    if weights.size <= count:
        rows = np.arange(weights.size)
    else:
        # The smallest of exponential variables with these rates: draws without replacement.
        rates = 1.0 if uniformly else weights.ravel()
        rows = np.argpartition(rng.exponential(size=weights.size) / rates, count)[:count]
    weight = weights.ravel()[rows]
    places = (rows // weights.shape[1], rows % weights.shape[1])
    return places, weight if uniformly or weights.size <= count else np.ones(len(rows))


def ridge(x: Array, target: Array, weights: Array, strength: float) -> Array:
    """Solve a weighted ridge regression; the strength is relative to the mean eigenvalue.

    Args:
        x: shape (rows, features).
        target: shape (rows, k).
        weights: shape (rows,).
        strength: the ridge.

    Returns:
        Weights of the features, shape (features, k).
    """
    root = np.sqrt(weights)[:, None].astype(x.dtype)
    weighted = x * root
    gram = (weighted.T @ weighted).astype(np.float64)
    gram[np.diag_indices_from(gram)] += strength * np.trace(gram) / len(gram) + 1e-12
    return np.linalg.solve(gram, weighted.T @ (root * target.astype(x.dtype)))


def _spread(deviations: Array) -> Array:
    """Return the root mean square of each column, shape (n,), of deviations, shape (m, cells, n)."""
    flat = _flat(deviations)
    return np.asarray(np.sqrt(np.diag(flat.T @ flat) / len(flat)))


def seen_range(states: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the lowest and the highest state that is predicted, shape (n,) each."""
    # A copy by columns: along short rows, minima take ten times as long.
    columns = np.ascontiguousarray(_flat(states).T)
    low, high = columns.min(axis=1), columns.max(axis=1)
    margin = _WIDENING * (high - low)
    return (low - margin).astype(np.float32), (high + margin).astype(np.float32)


def _flat(values: Array) -> Array:
    """Return values of shape (m, cells, n) as shape (m * cells, n); n may be 0."""
    return values.reshape(values.shape[0] * values.shape[1], values.shape[2])
