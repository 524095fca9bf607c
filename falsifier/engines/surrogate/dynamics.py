"""Dynamics learnt from whole trajectories: one nonlinear and one linear kind.

Both predict, cell by cell, the next state and the excess of each leaf's envelope (see ``grid.Trace``) from
the current state and input. The nonlinear dynamics use no earlier states. The linear dynamics predict
deviations from the best trajectory and use a few earlier cells, which accounts for initial transients and
hidden states.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.trace import Trace

# Predicted states are limited to the range of the simulated ones, widened by this share of it on both sides.
_WIDENING = 0.5


@dataclass(frozen=True, slots=True)
class Prediction:
    """Predicted traces.

    Attributes:
        states: coordinates at the grid points, shape (m, cells + 1, dimension).
        excess: excess of each leaf's envelope, shape (m, cells, leaves).
    """

    states: Array
    excess: Array


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
    """The initial state as a linear function of the first inputs and the parameters."""

    def __init__(self, traces: Sequence[Trace]) -> None:
        first = np.stack([t.states[0] for t in traces])
        self._mean = first.mean(axis=0)
        self._weights = None
        if np.ptp(first, axis=0).max(initial=0.0) > 1e-9 * max(1.0, float(np.abs(first).max(initial=0.0))):
            inputs = np.stack([t.inputs[0] for t in traces])
            self._centre = inputs.mean(axis=0)
            z = inputs - self._centre
            gram = z.T @ z + 1e-6 * np.eye(z.shape[1])
            self._weights = np.linalg.solve(gram, z.T @ (first - self._mean))

    def predict(self, inputs: Array) -> Array:
        """Return the initial states, shape (m, dimension), for inputs, shape (m, cells, inputs)."""
        if self._weights is None:
            return np.repeat(self._mean[None], len(inputs), axis=0)
        return np.asarray(self._mean + (inputs[:, 0] - self._centre) @ self._weights)


class FourierDynamics:
    """Nonlinear dynamics: increments by ridge regression on random Fourier features and linear terms.

    Each fit draws a new length scale and new random weights of the rows (a bootstrap). Successive fits then
    differ in regions that the data do not determine, which amounts to Thompson sampling.
    """

    def __init__(
        self, traces: Sequence[Trace], best: Sequence[int], settings: Settings, rng: np.random.Generator
    ) -> None:
        self._states = traces[0].states.shape[1]
        x = np.concatenate([np.concatenate([t.states[:-1], t.inputs], axis=1) for t in traces])
        target = np.concatenate(
            [np.concatenate([np.diff(t.states, axis=0), t.excess], axis=1) for t in traces]
        )
        weights = np.concatenate(
            [
                np.full(len(t.inputs), 1.0 + (settings.best_weight if i in best else 0.0))
                for i, t in enumerate(traces)
            ]
        )
        if len(x) > settings.most_rows:
            rows = rng.choice(len(x), settings.most_rows, replace=False, p=weights / weights.sum())
            x, target, weights = x[rows], target[rows], np.ones(settings.most_rows)
        mean, spread = x.mean(axis=0), x.std(axis=0) + 1e-3 * np.abs(x).max(axis=0) + 1e-9
        z = (x - mean) / spread
        width = z.shape[1]
        scale = rng.choice([0.7, 1.0, 2.0, 3.0]) * np.sqrt(width) / 1.5
        frequencies = rng.standard_normal((width, settings.features)) / scale
        phases = rng.uniform(0, 2 * np.pi, settings.features)
        amplitude = np.sqrt(2 / settings.features)
        phi = np.concatenate(
            [np.cos(z @ frequencies + phases) * amplitude, 0.3 * z, np.ones((len(z), 1))], axis=1
        )
        centre, unit = target.mean(axis=0), target.std(axis=0) + 1e-9
        solution = _ridge(
            phi, (target - centre) / unit, weights * rng.exponential(size=len(z)), settings.ridge
        )
        # For fast rollouts, all scalings are folded into a few single-precision matrices.
        solution = solution * unit
        raw = frequencies / spread[:, None]
        self._frequencies = raw.astype(np.float32)
        self._phases = (phases - mean @ raw).astype(np.float32)
        linear = solution[settings.features : -1] * 0.3 / spread[:, None]
        self._amplitudes = (solution[: settings.features] * amplitude).astype(np.float32)
        self._linear = linear.astype(np.float32)
        self._offset = (solution[-1] + centre - mean @ linear).astype(np.float32)
        self._low, self._high = _seen_range(traces)

    def predict(self, inputs: Array, start: Array) -> Prediction:
        """Predict m traces, cell by cell, in single precision; arguments as in ``Dynamics.predict``."""
        count, cells, _ = inputs.shape
        by_cell = np.ascontiguousarray(inputs.transpose(1, 0, 2), dtype=np.float32)
        n = self._states
        states = np.empty((cells + 1, count, n), np.float32)
        excess = np.empty((cells, count, self._offset.shape[0] - n), np.float32)
        states[0] = start
        # The contribution of the inputs to all features, for all cells at once.
        driven = by_cell @ self._frequencies[n:] + self._phases
        direct = by_cell @ self._linear[n:] + self._offset
        for k in range(cells):
            waves = np.cos(states[k] @ self._frequencies[:n] + driven[k])
            step = waves @ self._amplitudes + states[k] @ self._linear[:n] + direct[k]
            states[k + 1] = np.clip(states[k] + step[:, :n], self._low, self._high)
            excess[k] = step[:, n:]
        return Prediction(states.transpose(1, 0, 2), excess.transpose(1, 0, 2))


class DeviationDynamics:
    """Linear dynamics of deviations from the best trajectory, with several lags."""

    def __init__(
        self, traces: Sequence[Trace], best: Sequence[int], settings: Settings, rng: np.random.Generator
    ) -> None:
        self._base = traces[best[0]]
        self._lags = settings.lags
        self._state_unit = _spread([t.states - self._base.states for t in traces]) + 1e-12
        self._excess_unit = _spread([t.excess - self._base.excess for t in traces]) + 1e-12
        # Otherwise an input that has hardly varied so far would become a huge deviation as soon as it does.
        self._input_unit = np.maximum(_spread([t.inputs - self._base.inputs for t in traces]), 0.05)
        rows, targets, weights = [], [], []
        for i, trace in enumerate(traces):
            if i == best[0]:
                continue
            dy, du = self._deviations(trace.states, trace.inputs)
            cells = len(trace.inputs)
            rows.append(_lagged(dy, du, self._lags, cells))
            de = (trace.excess - self._base.excess) / self._excess_unit
            targets.append(np.concatenate([dy[self._lags :], de], axis=1))
            weights.append(np.full(cells, rng.exponential() + 0.2))
        x, target, weight = np.concatenate(rows), np.concatenate(targets), np.concatenate(weights)
        if len(x) > settings.most_rows:
            kept = rng.choice(len(x), settings.most_rows, replace=False)
            x, target, weight = x[kept], target[kept], weight[kept]
        self._weights = _ridge(x, target, weight, settings.linear_ridge)
        self._low, self._high = _seen_range(traces)

    def _deviations(self, states: Array, inputs: Array) -> tuple[Array, Array]:
        """Return deviations in units of their spread, preceded by zeros for the lags."""
        dy = (states - self._base.states[: states.shape[-2]]) / self._state_unit
        du = (inputs - self._base.inputs[: inputs.shape[-2]]) / self._input_unit
        pad = [(0, 0)] * (states.ndim - 2) + [(self._lags - 1, 0), (0, 0)]
        return np.pad(dy, pad), np.pad(du, pad)

    def predict(self, inputs: Array, start: Array) -> Prediction:
        """Predict m traces, cell by cell, as deviations; arguments as in ``Dynamics.predict``."""
        count, cells, _ = inputs.shape
        lags, n = self._lags, start.shape[1]
        initial = np.zeros((count, cells + 1, n))
        initial[:, 0] = start
        dy, du = self._deviations(initial, inputs)
        dy[:, lags:] = 0.0
        excess = np.empty((count, cells, self._weights.shape[1] - n))
        # The contribution of the inputs to every step, for all cells at once; the most recent cell comes
        # first.
        own, driving = self._weights[: lags * n], self._weights[lags * n :]
        driven = np.concatenate([du[:, lags - 1 - i : lags - 1 - i + cells] for i in range(lags)], axis=2)
        driven = driven @ driving
        for k in range(cells):
            past = np.concatenate([dy[:, k + lags - 1 - i] for i in range(lags)], axis=1)
            step = past @ own + driven[:, k]
            # An unstable fit must not overflow; deviations this large mean nothing anyway.
            dy[:, k + lags] = np.clip(step[:, :n], -30.0, 30.0)
            excess[:, k] = step[:, n:]
        states = self._base.states[: cells + 1] + dy[:, lags - 1 :] * self._state_unit
        return Prediction(
            np.clip(states, self._low, self._high), self._base.excess[:cells] + excess * self._excess_unit
        )


def _lagged(dy: Array, du: Array, lags: int, cells: int) -> Array:
    """Return rows [dy(k) ... dy(k - lags + 1), du(k) ... du(k - lags + 1)] for all cells k."""
    parts = [dy[lags - 1 - i : lags - 1 - i + cells] for i in range(lags)]
    parts += [du[lags - 1 - i : lags - 1 - i + cells] for i in range(lags)]
    return np.concatenate(parts, axis=1)


def _ridge(x: Array, target: Array, weights: Array, strength: float) -> Array:
    """Solve a weighted ridge regression; the strength is relative to the mean eigenvalue."""
    weighted = x * weights[:, None]
    gram = x.T @ weighted
    gram[np.diag_indices_from(gram)] += strength * np.trace(gram) / len(gram) + 1e-12
    return np.linalg.solve(gram, weighted.T @ target)


def _spread(deviations: Sequence[Array]) -> Array:
    return np.asarray(np.sqrt(np.mean([np.mean(d**2, axis=0) for d in deviations], axis=0)))


def _seen_range(traces: Sequence[Trace]) -> tuple[Array, Array]:
    low = np.min([t.states.min(axis=0) for t in traces], axis=0)
    high = np.max([t.states.max(axis=0) for t in traces], axis=0)
    return low - _WIDENING * (high - low), high + _WIDENING * (high - low)
