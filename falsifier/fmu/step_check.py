"""Whether the communication step is small enough: the same simulation with half of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from falsifier.core.model import Experiment, Model
from falsifier.core.signals import Signal


@dataclass(frozen=True, slots=True)
class Movement:
    """How far one output moves when the communication step is halved.

    Attributes:
        largest: largest distance between the two trajectories, in the output's unit.
        time: when it occurs, in s.
        span: largest minus smallest value of the finer trajectory, in the output's unit.
    """

    largest: float
    time: float
    span: float

    @property
    def relative(self) -> float:
        """Largest distance as a share of the span; 0 for an output that neither moves nor varies."""
        if self.span > 0.0:
            return self.largest / self.span
        return 0.0 if self.largest == 0.0 else float("inf")


def step_convergence(
    model: Model,
    experiment: Experiment,
    signals: Mapping[str, Signal],
    parameters: Mapping[str, float] | None = None,
) -> dict[str, Movement]:
    """Simulate twice, the second time with half of the step, and compare on the same output grid.

    Args:
        model: what simulates.
        experiment: times, outputs and the step that is in question.
        signals: inputs by name.
        parameters: parameter values by name.

    Returns:
        The movement of each output, by name.

    Raises:
        SimulationError: when one of the simulations fails.
    """
    step = experiment.step_size or experiment.output_interval
    coarse = model.simulate(signals, parameters or {}, experiment)
    fine = model.simulate(signals, parameters or {}, replace(experiment, step_size=step / 2))
    moved = {}
    for name in coarse.names:
        distance = np.abs(fine[name] - coarse[name])
        k = int(distance.argmax())
        moved[name] = Movement(float(distance[k]), float(coarse.times[k]), float(np.ptp(fine[name])))
    return moved
