"""The simulations so far, in the form that learning and planning need."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from falsifier.core.trajectory import Trajectory, is_discrete
from falsifier.engines.box import Array, learnable
from falsifier.engines.grid import Grid
from falsifier.engines.layout import Layout
from falsifier.engines.surrogate.automaton.predictions import AutomatonDynamics, AutomatonLearner
from falsifier.engines.surrogate.coordinates import Coordinates, choose_coordinates
from falsifier.engines.surrogate.objective import LeafValues, Objective, make_objective
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.trace import Trace, trace_of
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """One simulated candidate.

    Attributes:
        point: its point in the planning layout.
        trace: its trajectory on the grid.
        values: values of the objective's leaves, shape (1, cells + 1) each.
        robustness: robustness of the requirement.
        critical: critical time as a share of the horizon.
        arm: the engine's arm that proposed it; empty for other engines' candidates.
    """

    point: Array
    trace: Trace
    values: LeafValues
    robustness: float
    critical: float
    arm: str


@dataclass
class History:
    """Samples of one problem; the first trajectory determines coordinates and which signals are discrete."""

    problem: Problem
    grid: Grid
    layout: Layout
    settings: Settings
    samples: list[Sample] = field(default_factory=list)
    learner: AutomatonLearner = field(default_factory=AutomatonLearner)
    objective: Objective | None = None
    _coordinates: Coordinates | None = None
    _scaled: Objective | None = None

    def add(self, evaluation: Evaluation, arm: str) -> Sample | None:
        """Add an evaluation; return its sample, or None if it has no trajectory to learn from."""
        trajectory, robustness = evaluation.trajectory, evaluation.robustness
        if trajectory is None or robustness is None:
            return None
        trajectory, robustness = _learnable(trajectory), float(learnable(robustness))
        if self.objective is None:
            self._start(trajectory)
        assert self.objective is not None and self._coordinates is not None
        space = self.problem.space
        trace = trace_of(
            space, self.grid, self._coordinates, self.objective.leaves, evaluation.candidate, trajectory
        )
        cells = self.grid.cells
        self.learner.hear(space, self._coordinates.outputs, evaluation.candidate, trajectory, trace)
        values = self.objective.leaf_values(
            trace.states[None, : cells + 1], trace.excess[None, :cells], trace.inputs[None, :cells]
        )
        critical = evaluation.verdict.critical_time / (self.grid.step * cells) if evaluation.verdict else 1.0
        point = self.layout.point(evaluation.candidate)
        sample = Sample(point, trace, values, robustness, min(critical, 1.0), arm)
        self.samples.append(sample)
        self._scaled = None
        return sample

    def _start(self, trajectory: Trajectory) -> None:
        problem = self.problem
        driven = {r.name for r in problem.space.inputs}
        outputs = [name for name in problem.experiment.outputs if name not in driven]
        formula = problem.requirement.formula
        self._coordinates = choose_coordinates(formula, outputs, trajectory.units, trajectory)
        self.objective = make_objective(
            formula,
            problem.space,
            self.grid,
            self._coordinates,
            discrete=frozenset(
                name for name in outputs if is_discrete(trajectory[name], kind=problem.info.kind(name))
            ),
            stretches=self.settings.stretches,
            constants={
                name: float(trajectory[name][0])
                for name in formula.signals
                if name not in driven and name not in outputs
            },
        )

    def scaled_objective(self) -> Objective:
        """Return the objective, scaled by the spread of all samples."""
        assert self.objective is not None
        if self._scaled is None:
            self._scaled = self.objective.rescaled([s.values for s in self.samples])
        return self._scaled

    def copy(self) -> "History":
        """Return a copy whose automaton can be learnt without this one's; samples are shared."""
        return replace(self, learner=replace(self.learner))

    def automaton(self, seed: int) -> AutomatonDynamics | None:
        """Return the automaton that explains the samples, or None; the seed is for its learning."""
        return self.learner.current(self.scaled_objective(), np.random.default_rng([seed, len(self.samples)]))

    @property
    def points(self) -> Array:
        """Points of all samples, shape (samples, d)."""
        return np.array([s.point for s in self.samples]).reshape(-1, self.layout.dimension)

    def direct_costs(self) -> list[float]:
        """Return the costs for the search without dynamics.

        These are the robustness if it is negative or has a slope, else the mean of the relaxed formulas'.
        """
        if not self.samples or self.objective is None or not self.objective.is_relaxed:
            return [s.robustness for s in self.samples]
        relaxed = scaled_costs(self.samples, self.scaled_objective()).tolist()
        return [
            s.robustness if s.robustness < 0 else cost for s, cost in zip(self.samples, relaxed, strict=True)
        ]


def scaled_costs(samples: Sequence[Sample], objective: Objective) -> Array:
    """Return the scaled robustness of the simulated traces, shape (samples,)."""
    stacked = [np.concatenate(leaf) for leaf in zip(*(s.values for s in samples), strict=True)]
    return np.asarray(objective.cost(stacked), dtype=np.float64)


def _learnable(trajectory: Trajectory) -> Trajectory:
    return replace(trajectory, columns={name: learnable(c) for name, c in trajectory.columns.items()})
