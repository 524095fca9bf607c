"""The kinds of learnt dynamics: choice of the one to plan on, and correction by their past errors."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.layout import Layout
from falsifier.engines.surrogate.automaton.predictions import AutomatonDynamics
from falsifier.engines.surrogate.coarse import Envelope
from falsifier.engines.surrogate.dynamics import (
    DeviationDynamics,
    Dynamics,
    FourierDynamics,
    StartState,
    Traces,
)
from falsifier.engines.surrogate.objective import LeafValues, Objective
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.switched import SwitchedDynamics, has_modes
from falsifier.engines.surrogate.trace import Trace
from falsifier.stl import Verdict

_KINDS: dict[str, type[FourierDynamics] | type[DeviationDynamics] | type[SwitchedDynamics]] = {
    "nonlinear": FourierDynamics,
    "linear": DeviationDynamics,
    "switched": SwitchedDynamics,
}
AUTOMATON = "automaton"


@dataclass(frozen=True, slots=True, eq=False)
class Forecast:
    """Predictions for one point, made before its simulation.

    Attributes:
        values: predicted values of the objective's leaves, by name of the dynamics.
        chosen: name of the dynamics used for planning.
        cost: scaled robustness predicted by these.
    """

    values: dict[str, LeafValues]
    chosen: str
    cost: float


class Ensemble:
    """Fits all kinds of dynamics, prefers the one with the smallest recent errors, and corrects its leaves.

    The errors are those of predictions made before the simulation, not of the fit.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._errors: dict[str, list[float]] = {}
        self._deltas: list[list[float]] = []
        self._missed: list[bool] = []
        self._fitted: dict[str, Dynamics] = {}
        self._start: StartState | None = None
        self._surprised = False
        self._load = 0.0
        self.chosen = ""

    @property
    def is_trusted(self) -> bool:
        """Whether recent predictions of the better dynamics were good."""
        errors = self._recent_errors()
        return bool(errors) and min(errors.values()) < self._settings.trusted_error

    @property
    def recent_error(self) -> float:
        """Recent error of the dynamics chosen last, as a share of the margins' spread; inf if unknown."""
        return self._recent_errors().get(self.chosen, float("inf"))

    @property
    def misses(self) -> int:
        """Number of forecasts, counted back from the last one, of violations that did not occur."""
        count = 0
        for missed in reversed(self._missed):
            if not missed:
                break
            count += 1
        return count

    def copy(self) -> "Ensemble":
        """Return a copy that can be fitted without this one."""
        other = copy(self)
        other._errors = {name: list(errors) for name, errors in self._errors.items()}
        return other

    def fit(
        self,
        traces: Sequence[Trace],
        best: Sequence[int],
        rng: np.random.Generator,
        *,
        automaton: AutomatonDynamics | None = None,
        switched: bool = False,
    ) -> None:
        """Fit to traces, of which ``best`` have the lowest robustness, and choose the dynamics to plan on.

        Args:
            traces: the traces.
            best: indices of the best ones.
            rng: random generator.
            automaton: the automaton, if one explains the traces.
            switched: whether the times of mode changes matter, so that dynamics with modes are fitted, too.
        """
        stacked = Traces.of(traces)
        self._fitted = {
            name: kind(stacked, best, self._settings, rng)
            for name, kind in _KINDS.items()
            if name != "switched" or (switched and has_modes(stacked.states))
        }
        self._start = StartState(stacked.states[:, 0], stacked.inputs[:, 0])
        if automaton is not None:
            self._fitted[AUTOMATON] = automaton
            self._errors.setdefault(AUTOMATON, [automaton.error])
        self._load = automaton.load if automaton is not None else 0.0
        errors = self._recent_errors()
        if self.is_exact or (errors and rng.random() >= self._settings.exploration):
            self.chosen = min(errors, key=lambda name: errors[name])
        else:
            self.chosen = str(rng.choice(list(self._fitted)))

    @property
    def is_exact(self) -> bool:
        """Whether there is an automaton, and recent simulations were nearly what it predicted."""
        return self._recent_errors().get(AUTOMATON, np.inf) < self._settings.exact_error

    @property
    def is_surprised(self) -> bool:
        """Whether the last simulation was not what the automaton had predicted."""
        return self._surprised

    @property
    def load(self) -> float:
        """How long a roll-out of the automaton takes, compared with a usual one; 0 without one."""
        return self._load

    def predictor(self, layout: Layout, objective: Objective) -> Callable[[Array], Array]:
        """Return a function from points, shape (m, d), to their predicted costs, shape (m,)."""
        corrected = self._corrected(objective)

        def predict(points: Array) -> Array:
            return corrected.cost(self._values(self.chosen, layout, corrected, points))

        return predict

    def verdicts(self, layout: Layout, objective: Objective, points: Array) -> list[Verdict]:
        """Return the verdicts predicted for points, shape (m, d), in the requirement's own unit."""
        corrected = self._corrected(objective).plain()
        return corrected.verdicts(self._values(self.chosen, layout, corrected, points))

    def forecast(self, layout: Layout, objective: Objective, point: Array) -> Forecast:
        """Return all kinds' predictions for one point, to be passed to ``judge`` after its simulation."""
        values = {name: self._values(name, layout, objective, point[None]) for name in self._fitted}
        cost = float(self._corrected(objective).cost(values[self.chosen])[0])
        return Forecast(values, self.chosen, cost)

    def judge(self, forecast: Forecast, true: LeafValues, objective: Objective, *, violated: bool) -> None:
        """Record the errors of a forecast, given the simulated values of the leaves."""
        for name, values in forecast.values.items():
            self._errors.setdefault(name, []).append(_error(objective, values, true))
        # Only a prediction that the automaton made can surprise.
        foretold = AUTOMATON in forecast.values
        self._surprised = foretold and self._errors[AUTOMATON][-1] >= self._settings.surprise
        self._missed.append(forecast.cost < 0 and not violated)
        self._deltas.append(_deltas(objective, forecast.values[forecast.chosen], true))

    def _values(self, name: str, layout: Layout, objective: Objective, points: Array) -> LeafValues:
        assert self._start is not None
        inputs = layout.inputs(points, objective.grid)
        prediction = self._fitted[name].predict(inputs, self._start.predict(inputs))
        return objective.leaf_values(prediction.states, prediction.excess, inputs)

    def _corrected(self, objective: Objective) -> Objective:
        settings = self._settings
        if len(self._deltas) < settings.offset_window:
            return objective
        offsets = np.median(self._deltas[-settings.offset_window :], axis=0)
        return objective.shifted([float(v) for v in offsets], limit=settings.offset_limit)

    def _recent_errors(self) -> dict[str, float]:
        recent = self._settings.recent_errors
        return {
            name: float(np.median(e[-recent:])) for name, e in self._errors.items() if name in self._fitted
        }


def _error(objective: Objective, predicted: LeafValues, true: LeafValues) -> float:
    """Return the root mean square error of the scaled leaf values, averaged over the leaves."""
    errors = [
        np.sqrt(np.mean(((p - t) / scale) ** 2))
        for p, t, scale in zip(predicted, true, objective.scales, strict=True)
    ]
    return float(np.mean(errors))


def _deltas(objective: Objective, predicted: LeafValues, true: LeafValues) -> list[float]:
    """Return for each leaf the true minus the predicted extreme over the horizon."""
    return [
        _extreme(leaf.envelope, t) - _extreme(leaf.envelope, p)
        for leaf, p, t in zip(objective.leaves, predicted, true, strict=True)
    ]


def _extreme(envelope: Envelope, values: Array) -> float:
    match envelope:
        case "low":
            return float(values.min())
        case "high":
            return float(values.max())
        case "sample":
            return float(np.median(values))
