"""Linear dynamics learnt from whole trajectories, as deviations from the best one, with several lags.

Deviations cancel initial transients and set points; lags account for hidden states. A roll-out predicts all
candidates of a population at once: one matrix product per cell. A forecaster keeps how good predictions were.
"""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.layout import Array, Layout, TimeGrid
from falsifier.engines.surrogate.predicted_cost import Margins, PredictedCost
from falsifier.engines.surrogate.settings import Settings
from falsifier.stl import Verdict

# Predicted outputs are limited to the range of the simulated ones, widened by this share of it on both sides.
_WIDENING = 0.5
# Largest predicted deviation, in units of the spread: an unstable fit must not overflow, and deviations this
# large mean nothing anyway.
_FAR = 30.0
# An input that has hardly varied so far would otherwise become a huge deviation as soon as it does.
_LEAST_INPUT_UNIT = 0.05
# Maximum number of rows of a regression, and of products: rows times the square of the features. They limit
# the time of a fit.
_MOST_ROWS, _MOST_PRODUCTS = 3000, 3e7
# Number of the last predictions whose median error is the recent error.
_RECENT = 4
# Recent error, as a share of the margins' spread, below which predictions are trusted.
_TRUSTED = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """The trajectory of one simulation on the time grid.

    Attributes:
        inputs: mean of each input in each cell, and the parameters, scaled to [0, 1], shape
            (all_cells, inputs + parameters).
        states: outputs at the grid points, shape (all_cells + 1, outputs).
    """

    inputs: Array
    states: Array


class LinearDynamics:
    """Predicts the outputs of a population from its inputs.

    Args:
        traces: at least two simulations.
        best: index of the trace from which deviations are learnt.
        settings: lags and regularisation.
        rng: weighs the traces at random, so that repeated fits explore what the data do not determine.
    """

    def __init__(
        self, traces: Sequence[Trace], best: int, settings: Settings, rng: np.random.Generator
    ) -> None:
        states, inputs = (
            np.stack(part) for part in zip(*((t.states, t.inputs) for t in traces), strict=True)
        )
        self._base, self._lags = traces[best], settings.lags
        others = np.arange(len(traces)) != best
        self._state_unit = _spread(states[others] - self._base.states) + 1e-12
        self._input_unit = np.maximum(_spread(inputs[others] - self._base.inputs), _LEAST_INPUT_UNIT)
        dy, du = self._deviations(states[others], inputs[others])
        weights = rng.exponential(size=int(others.sum())) + 0.2
        features = self._lags * (dy.shape[2] + du.shape[2])
        cells = inputs.shape[1]
        rows = _drawn(len(dy) * cells, int(min(_MOST_ROWS, _MOST_PRODUCTS / features**2)), rng)
        which, at = rows // cells, rows % cells
        x = np.concatenate([_lagged(part, self._lags, which, at) for part in (dy, du)], axis=1)
        linear = ridge(x, dy[which, at + self._lags], weights[which], settings.ridge).T
        # In single precision: rounding is far below what the dynamics do not know.
        own, driving = np.split(linear.astype(np.float32), [self._lags * dy.shape[2]], axis=1)
        self._own, self._driving = np.ascontiguousarray(own), np.ascontiguousarray(driving)
        low, high = states.min(axis=(0, 1)), states.max(axis=(0, 1))
        self._low, self._high = low - _WIDENING * (high - low), high + _WIDENING * (high - low)
        self._start = _StartState(states[:, 0], inputs[:, 0])

    def predict(self, inputs: Array) -> Array:
        """Return the outputs, shape (m, cells + 1, outputs), for scaled inputs, shape (m, cells, inputs)."""
        count, cells, driven = inputs.shape
        first, du = self._deviations(self._start.predict(inputs)[:, None], inputs)
        n, lags = first.shape[2], self._lags
        # Time and signal are one axis, so that the last few cells of all candidates are one matrix.
        drive = np.ascontiguousarray(du.transpose(1, 2, 0), dtype=np.float32).reshape(-1, count)
        dy = np.empty(((lags + cells) * n, count), np.float32)
        dy[: lags * n] = first.transpose(1, 2, 0).reshape(-1, count)
        for k in range(cells):
            after = dy[(k + lags) * n : (k + lags + 1) * n]
            np.matmul(self._own, dy[k * n : (k + lags) * n], out=after)
            after += self._driving @ drive[k * driven : (k + lags) * driven]
            np.clip(after, -_FAR, _FAR, out=after)
        deviations = dy[(lags - 1) * n :].reshape(cells + 1, n, count).transpose(2, 0, 1)
        states = deviations * self._state_unit + self._base.states[: cells + 1]
        return np.asarray(np.clip(states, self._low, self._high))

    def _deviations(self, states: Array, inputs: Array) -> tuple[Array, Array]:
        """Return deviations in units of their spread, preceded by zeros for the lags."""
        dy = (states - self._base.states[: states.shape[1]]) / self._state_unit
        du = (inputs - self._base.inputs[: inputs.shape[1]]) / self._input_unit
        before = ((0, 0), (self._lags - 1, 0), (0, 0))
        return np.pad(dy, before), np.pad(du, before)


class _StartState:
    """The outputs at the start as a linear function of the first inputs and the parameters.

    Args:
        first: outputs at the start, shape (m, n).
        inputs: scaled inputs and parameters in the first cell, shape (m, p).
    """

    def __init__(self, first: Array, inputs: Array) -> None:
        self._mean, self._centre = first.mean(axis=0), inputs.mean(axis=0)
        z = inputs - self._centre
        gram = z.T @ z + 1e-6 * np.eye(z.shape[1])
        self._weights = np.linalg.solve(gram, z.T @ (first - self._mean))

    def predict(self, inputs: Array) -> Array:
        """Return the outputs at the start, shape (m, n), for inputs, shape (m, cells, p)."""
        return np.asarray(self._mean + (inputs[:, 0] - self._centre) @ self._weights)


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
    weighted = x * weights[:, None]
    gram = weighted.T @ x
    gram[np.diag_indices_from(gram)] += strength * np.trace(gram) / len(gram) + 1e-12
    return np.linalg.solve(gram, weighted.T @ target)


def _drawn(rows: int, most: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return the rows of a regression, drawn without repetition if there are too many."""
    return np.arange(rows) if rows <= most else np.asarray(rng.choice(rows, most, replace=False))


def _lagged(values: Array, lags: int, which: NDArray[np.intp], at: NDArray[np.intp]) -> Array:
    """Return the values of ``lags`` cells from some cells of some traces, shape (rows, lags * n)."""
    windows = np.lib.stride_tricks.sliding_window_view(values, lags, axis=1)[which, at]
    return windows.swapaxes(1, 2).reshape(len(which), -1)


def _spread(deviations: Array) -> Array:
    """Return the root mean square of each column, shape (n,), of deviations, shape (m, cells, n)."""
    return np.asarray(np.sqrt(np.mean(deviations**2, axis=(0, 1))))


@dataclass(frozen=True, slots=True, eq=False)
class Forecast:
    """Prediction for one point, made before its simulation.

    Attributes:
        margins: predicted margins of the predicates.
        cost: predicted scaled robustness.
    """

    margins: Margins
    cost: float


class Forecaster:
    """Predicts with the latest fit, and keeps the errors of predictions made before their simulation."""

    def __init__(self, settings: Settings, layout: Layout) -> None:
        self._settings, self._layout = settings, layout
        self._errors: list[float] = []
        self._missed: list[bool] = []
        self._dynamics: LinearDynamics | None = None

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

    def fitted(self, traces: Sequence[Trace], best: int, rng: np.random.Generator) -> "Forecaster":
        """Return this with dynamics learnt from traces, of which ``best`` has the lowest cost."""
        other = copy(self)
        other._dynamics = LinearDynamics(traces, best, self._settings, rng)
        return other

    def predictor(self, cost: PredictedCost) -> Callable[[Array], Array]:
        """Return a function from points, shape (m, d), to their predicted costs, shape (m,)."""
        return lambda points: cost.cost(self._margins(cost, points))

    def outputs(self, points: Array, grid: TimeGrid) -> Array:
        """Return the predicted outputs of points, shape (m, cells + 1, outputs)."""
        assert self._dynamics is not None, "fitted first"
        return self._dynamics.predict(self._layout.inputs(points, grid))

    def verdicts(self, cost: PredictedCost, points: Array) -> list[Verdict]:
        """Return the verdicts predicted for points, shape (m, d), in the requirement's own unit."""
        return cost.plain().verdicts(self._margins(cost, points))

    def forecast(self, cost: PredictedCost, point: Array) -> Forecast:
        """Return the prediction for one point, to be passed to ``judge`` after its simulation."""
        margins = self._margins(cost, point[None])
        return Forecast(margins, float(cost.cost(margins)[0]))

    def judge(self, forecast: Forecast, true: Margins, cost: PredictedCost, *, violated: bool) -> None:
        """Record the error of a forecast, given the simulated margins of the predicates."""
        errors = [
            np.sqrt(np.mean(((p - t) / scale) ** 2))
            for p, t, scale in zip(forecast.margins, true, cost.scales, strict=True)
        ]
        self._errors.append(float(np.mean(errors)))
        self._missed.append(forecast.cost < 0 and not violated)

    def _margins(self, cost: PredictedCost, points: Array) -> Margins:
        assert self._dynamics is not None, "fitted first"
        inputs = self._layout.inputs(points, cost.grid)
        return cost.margins(self._dynamics.predict(inputs), inputs)
