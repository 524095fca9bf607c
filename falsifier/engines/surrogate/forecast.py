"""What the learnt dynamics predict for points, and how good their predictions were."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from math import inf

import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.layout import Layout
from falsifier.engines.surrogate.dynamics import LinearDynamics, Trace
from falsifier.engines.surrogate.predicted_cost import Margins, PredictedCost
from falsifier.engines.surrogate.settings import Settings
from falsifier.stl import Verdict

# Number of the last predictions whose median error is the recent error.
_RECENT = 4
# Recent error, as a share of the margins' spread, below which predictions are trusted.
_TRUSTED = 0.5


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
