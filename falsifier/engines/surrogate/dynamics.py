"""Linear dynamics learnt from whole trajectories, as deviations from one of the best, with several lags.

Deviations cancel initial transients and set points; lags account for hidden states. A roll-out predicts all
candidates of a population at once: one matrix product per cell. Its errors at similar inputs correct it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.layout import Array
from falsifier.engines.surrogate.corrections import Corrections
from falsifier.engines.surrogate.predicted_cost import Margins, PredictedCost

# Number of cells that the dynamics look back; hidden states need several.
_LAGS = 6
# Ridge of a regression, relative to the mean eigenvalue: a few simulations do not say what twenty inputs do.
_RIDGE = 1e-2
# Predicted outputs are limited to the range of the simulated ones, widened by this share of it on both sides.
_WIDENING = 0.5
# Largest predicted deviation, in spreads: an unstable fit must not overflow, and so far off it means nothing.
_FAR = 30.0
# An input that has hardly varied so far would otherwise become a huge deviation as soon as it does.
_LEAST_INPUT_UNIT = 0.05
# Maximum numbers of rows of a regression and of products, rows times features squared: they limit its time.
_MOST_ROWS, _MOST_PRODUCTS = 3000, 3e7
# Number of the last predictions whose median error is the recent error.
_RECENT = 4
# Recent error, as a share of the margins' spread, below which predictions are trusted.
_TRUSTED = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """The trajectory of one simulation on the time grid."""

    # Mean of each input in each cell, and the parameters, in [0, 1], shape (all_cells, inputs + parameters).
    inputs: Array
    states: Array  # outputs at the grid points, shape (all_cells + 1, outputs)


class LinearDynamics:
    """Predicts the outputs of a population from its inputs.

    Args:
        traces: at least two simulations.
        best: index of the trace from which deviations are learnt.
        cells: number of cells that are predicted.
        rng: weighs the traces at random, so that repeated fits explore what the data do not determine.
    """

    def __init__(self, traces: Sequence[Trace], best: int, cells: int, rng: np.random.Generator) -> None:
        states, inputs = np.stack([t.states for t in traces]), np.stack([t.inputs for t in traces])
        self._base = traces[best]
        others = np.arange(len(traces)) != best
        self._state_unit = _spread(states[others] - self._base.states) + 1e-12
        self._input_unit = np.maximum(_spread(inputs[others] - self._base.inputs), _LEAST_INPUT_UNIT)
        dy, du = self._deviations(states[others], inputs[others])
        weights = rng.exponential(size=int(others.sum())) + 0.2
        features = _LAGS * (dy.shape[2] + du.shape[2])
        length = inputs.shape[1]
        count, most = len(dy) * length, int(min(_MOST_ROWS, _MOST_PRODUCTS / features**2))
        rows = np.arange(count) if count <= most else rng.choice(count, most, replace=False)
        which, at = rows // length, rows % length
        x = np.concatenate([_lagged(part, which, at) for part in (dy, du)], axis=1)
        linear = _ridge(x, dy[which, at + _LAGS], weights[which]).T
        # In single precision: rounding is far below what the dynamics do not know.
        own, driving = np.split(linear.astype(np.float32), [_LAGS * dy.shape[2]], axis=1)
        self._own, self._driving = np.ascontiguousarray(own), np.ascontiguousarray(driving)
        low, high = states.min(axis=(0, 1)), states.max(axis=(0, 1))
        self._low, self._high = low - _WIDENING * (high - low), high + _WIDENING * (high - low)
        # The outputs at the start are a linear function of the first inputs and the parameters.
        self._first, self._centre = states[:, 0].mean(axis=0), inputs[:, 0].mean(axis=0)
        z = inputs[:, 0] - self._centre
        self._start = np.linalg.solve(z.T @ z + 1e-6 * np.eye(z.shape[1]), z.T @ (states[:, 0] - self._first))
        driven = inputs[:, :cells]
        errors = (states[:, : cells + 1] - self._roll_out(driven)) / self._state_unit
        self._corrections = Corrections(driven, errors[:, 1:])

    def predict(self, inputs: Array) -> Array:
        """Return the outputs, shape (m, cells + 1, outputs), for scaled inputs, shape (m, cells, inputs)."""
        states = self._roll_out(inputs)
        states[:, 1:] += self._corrections.at(inputs) * self._state_unit
        return np.asarray(np.clip(states, self._low, self._high))

    def _roll_out(self, inputs: Array) -> Array:
        count, cells, driven = inputs.shape
        start = self._first + (inputs[:, 0] - self._centre) @ self._start
        first, du = self._deviations(start[:, None], inputs)
        n, lags = first.shape[2], _LAGS
        # Time and signal are one axis, so that the last few cells of all candidates are one matrix.
        drive = np.ascontiguousarray(du.transpose(1, 2, 0), dtype=np.float32).reshape(-1, count)
        dy = np.empty(((lags + cells) * n, count), np.float32)
        dy[: lags * n] = first.transpose(1, 2, 0).reshape(-1, count)
        for k in range(cells):
            after = dy[(k + lags) * n : (k + lags + 1) * n]
            np.matmul(self._own, dy[k * n : (k + lags) * n], out=after)
            after += self._driving @ drive[k * driven : (k + lags) * driven]
            np.minimum(after, _FAR, out=after)  # the two take half as long as np.clip
            np.maximum(after, -_FAR, out=after)
        deviations = dy[(lags - 1) * n :].reshape(cells + 1, n, count).transpose(2, 0, 1)
        states = deviations * self._state_unit + self._base.states[: cells + 1]
        return np.asarray(np.clip(states, self._low, self._high))

    def _deviations(self, states: Array, inputs: Array) -> tuple[Array, Array]:
        """Return deviations in units of their spread, preceded by zeros for the lags."""
        dy = (states - self._base.states[: states.shape[1]]) / self._state_unit
        du = (inputs - self._base.inputs[: inputs.shape[1]]) / self._input_unit
        before = ((0, 0), (_LAGS - 1, 0), (0, 0))
        return np.pad(dy, before), np.pad(du, before)


def _ridge(x: Array, target: Array, weights: Array) -> Array:
    """Solve a weighted ridge regression of targets, shape (rows, k), on x, shape (rows, features).

    The weights of the rows have shape (rows,), those of the features that are returned (features, k).
    """
    weighted = x * weights[:, None]
    gram = weighted.T @ x
    gram[np.diag_indices_from(gram)] += _RIDGE * np.trace(gram) / len(gram) + 1e-12
    return np.linalg.solve(gram, weighted.T @ target)


def _lagged(values: Array, which: NDArray[np.intp], at: NDArray[np.intp]) -> Array:
    """Return the values of the lags from some cells of some traces on, shape (rows, lags * n)."""
    windows = np.lib.stride_tricks.sliding_window_view(values, _LAGS, axis=1)[which, at]
    return windows.swapaxes(1, 2).reshape(len(which), -1)


def _spread(deviations: Array) -> Array:
    """Return the root mean square of each column, shape (n,), of deviations, shape (m, cells, n)."""
    return np.asarray(np.sqrt(np.mean(deviations**2, axis=(0, 1))))


class Forecasts:
    """How good the predictions were that were made before their simulation."""

    def __init__(self) -> None:
        self._errors: list[float] = []
        self._missed: list[bool] = []

    @property
    def is_trusted(self) -> bool:
        """Whether recent predictions were good."""
        return self.recent_error < _TRUSTED

    @property
    def recent_error(self) -> float:
        """Recent error as a share of the margins' spread; inf if unknown."""
        return float(np.median(self._errors[-_RECENT:])) if self._errors else inf

    @property
    def misses(self) -> int:
        """Number of forecasts, counted back from the last one, of violations that did not occur."""
        return next((i for i, missed in enumerate(reversed(self._missed)) if not missed), len(self._missed))

    def judge(self, predicted: Margins, true: Margins, cost: PredictedCost, *, violated: bool) -> None:
        """Record the error of the margins predicted for one point, given the simulated ones."""
        errors = [
            np.sqrt(np.mean(((p - t) / scale) ** 2))
            for p, t, scale in zip(predicted, true, cost.scales, strict=True)
        ]
        self._errors.append(float(np.mean(errors)))
        self._missed.append(bool(cost.cost(predicted)[0] < 0) and not violated)
