"""A model whose outputs depend on the communication step, as a coarse co-simulation's do."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from falsifier.core.experiment import Experiment
from falsifier.core.model import ModelInfo
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.errors import SimulationError
from falsifier.problem.problem import Problem
from falsifier.testing import lag_problem


@dataclass(frozen=True, slots=True)
class EulerModel:
    """The lag x' = u - x, by explicit Euler with the communication step."""

    info: ModelInfo
    smallest_step: float = 0.0

    def simulate(
        self, signals: Mapping[str, Signal], parameters: Mapping[str, float], experiment: Experiment
    ) -> Trajectory:
        step = experiment.step
        if step < self.smallest_step:
            raise SimulationError(f"the step {step:g} s is too small")
        every = round(experiment.output_interval / step)
        u = signals["u"].sample(np.arange(every * (experiment.samples - 1), dtype=np.float64) * step)
        x = np.zeros(len(u) + 1)
        for k in range(len(u)):
            x[k + 1] = x[k] + step * (u[k] - x[k])
        return Trajectory(experiment.times, {"x": x[::every]})

    def close(self) -> None:
        pass


def euler_problem(stl: str = "G[1,1] (x <= 0.65)", *, smallest_step: float = 0.0) -> Problem:
    problem = lag_problem(stl)
    return replace(problem, model=EulerModel(problem.info, smallest_step))
