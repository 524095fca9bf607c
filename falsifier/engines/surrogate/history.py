"""The simulations so far, in the form that learning and planning need."""

from dataclasses import dataclass, field

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.trajectory import Trajectory, is_discrete
from falsifier.engines.layout import Array, Layout, TimeGrid, learnable
from falsifier.engines.surrogate.dynamics import Trace
from falsifier.engines.surrogate.predicted_cost import Margins, PredictedCost
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem

# Maximum number of outputs that are predicted: those of the formula, then others. Limits the time of a fit.
_MOST_OUTPUTS = 12
# Samples per cell from which the mean of an input is calculated: none is at an end, so that a held input is
# read between its switches.
_FINE = 8


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedPoint:
    """One simulated candidate."""

    point: Array  # its point in the layout
    trace: Trace  # its trajectory on the grid
    margins: Margins  # margins of the formula's predicates, shape (1, cells + 1) each
    robustness: float
    critical: float  # critical time as a share of the horizon


@dataclass
class History:
    """Samples of one problem; the first trajectory determines which signals are discrete."""

    problem: Problem
    grid: TimeGrid  # the grid of the traces
    layout: Layout  # the layout of the points
    samples: list[SimulatedPoint] = field(default_factory=list)  # what was simulated
    # The cost of predictions in the requirement's own unit; None before the first sample.
    cost: PredictedCost | None = None
    _discrete: frozenset[str] = frozenset()
    _scaled: PredictedCost | None = None

    def add(self, evaluation: Evaluation, point: Array) -> SimulatedPoint | None:
        """Add the evaluation of a point; return its sample, or None if there is nothing to learn from."""
        trajectory, robustness = evaluation.trajectory, evaluation.robustness
        if trajectory is None or robustness is None:
            return None
        if self.cost is None:
            self.cost = self._first_cost(trajectory)
        trace = self._trace(evaluation.candidate, trajectory)
        cells = self.grid.cells
        margins = self.cost.margins(trace.states[None, : cells + 1], trace.inputs[None, :cells])
        critical = evaluation.verdict.critical_time / (self.grid.step * cells) if evaluation.verdict else 1.0
        sample = SimulatedPoint(point, trace, margins, float(learnable(robustness)), min(critical, 1.0))
        self.samples.append(sample)
        self._scaled = None
        return sample

    def _first_cost(self, trajectory: Trajectory) -> PredictedCost:
        problem, formula = self.problem, self.problem.requirement.formula
        driven = {r.name for r in problem.space.inputs}
        outputs = [n for n in problem.experiment.outputs if n not in driven and n in trajectory.columns]
        outputs.sort(key=lambda name: name not in formula.signals)
        self._discrete = frozenset(
            name for name in outputs if is_discrete(learnable(trajectory[name]), kind=problem.info.kind(name))
        )
        return PredictedCost.of(
            formula,
            problem.space,
            self.grid,
            outputs[: max(_MOST_OUTPUTS, len(set(outputs) & set(formula.signals)))],
            discrete=self._discrete,
            constants={
                name: float(learnable(trajectory[name][0]))
                for name in formula.signals
                if name not in driven and name not in outputs
            },
        )

    def _trace(self, candidate: Candidate, trajectory: Trajectory) -> Trace:
        """Return a simulation on the grid; only samples at the grid points are read of the trajectory."""
        space, grid = self.problem.space, self.grid
        points = np.round(np.arange(grid.all_cells + 1) * grid.step / trajectory.step).astype(int)
        points = np.minimum(points, len(trajectory) - 1)
        columns = [
            learnable(trajectory[name][points])
            if name in trajectory.columns
            else self.samples[-1].trace.states[:, k]  # an internal variable that could not be read this time
            for k, name in enumerate(self.outputs)
        ]
        states = np.stack(columns, axis=1) if columns else np.empty((len(points), 0))
        fine = (np.arange(grid.all_cells * _FINE) + 0.5) * grid.step / _FINE
        inputs = []
        for r in space.inputs:
            means = candidate.signals[r.name].sample(fine).reshape(grid.all_cells, _FINE).mean(axis=1)
            inputs.append(r.share_of(means))
        for p in space.parameters:
            inputs.append(np.full(grid.all_cells, p.share_of(candidate.parameters[p.name])))
        return Trace(np.stack(inputs, axis=1), states)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs in the traces, in order."""
        return self.cost.outputs if self.cost else ()

    @property
    def continuous(self) -> list[str]:
        """The outputs that are not discrete and varied in the latest sample."""
        varied = np.ptp(self.samples[-1].trace.states, axis=0) > 0
        return [n for n, v in zip(self.outputs, varied, strict=True) if v and n not in self._discrete]

    def scaled_cost(self) -> PredictedCost:
        """Return the cost of predictions, scaled by the spread of all samples."""
        assert self.cost is not None, "there is a sample"
        if self._scaled is None:
            self._scaled = self.cost.rescaled([s.margins for s in self.samples])
        return self._scaled

    @property
    def points(self) -> Array:
        """Points of all samples, shape (samples, d)."""
        return np.array([s.point for s in self.samples]).reshape(-1, self.layout.dimension)

    def by_scaled_cost(self) -> list[int]:
        """Return the indices of the samples, that with the lowest scaled robustness first."""
        cost = self.scaled_cost()
        stacked = [
            np.concatenate(predicate) for predicate in zip(*(s.margins for s in self.samples), strict=True)
        ]
        return [int(i) for i in np.argsort(cost.cost(stacked), kind="stable")]
