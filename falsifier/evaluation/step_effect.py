"""Check whether the communication step is small enough, by simulating again with half of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from falsifier.core.model import Experiment, Model
from falsifier.core.signals import Signal


@dataclass(frozen=True, slots=True)
class Movement:
    """How much one output changes if the communication step is halved.

    Attributes:
        largest: maximum distance between the two trajectories, in the output's unit.
        time: time in s at which it occurs.
        span: maximum minus minimum of the finer trajectory, in the output's unit.
    """

    largest: float
    time: float
    span: float

    @property
    def relative(self) -> float:
        """Maximum distance as a share of the span; 0 for an output that is constant in both trajectories."""
        if self.span > 0.0:
            return self.largest / self.span
        return 0.0 if self.largest == 0.0 else float("inf")


def step_convergence(
    model: Model,
    experiment: Experiment,
    signals: Mapping[str, Signal],
    parameters: Mapping[str, float] | None = None,
) -> dict[str, Movement]:
    """Simulate with the step and with half of it, and compare the outputs on the same grid.

    Args:
        model: the model to simulate.
        experiment: times, outputs and the step to check.
        signals: inputs by name.
        parameters: parameter values by name.

    Returns:
        How much each output changes, by name.

    Raises:
        SimulationError: if one of the simulations fails.
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


def sufficient_step(
    model: Model, experiment: Experiment, signals: Mapping[str, Signal], *, share: float, halvings: int
) -> float | None:
    """Return the largest step in s at which halving changes no output by more than a share of its range.

    Args:
        model: the model to simulate.
        experiment: times, outputs, and the step to begin with.
        signals: inputs by name.
        share: the share, such as 0.01.
        halvings: maximum number of times that the step is halved.

    Returns:
        The step, which is the first one or a half, a quarter, ... of it; None if none of these is enough.

    Raises:
        SimulationError: if a simulation fails.
    """
    step = experiment.step_size or experiment.output_interval
    for _ in range(halvings + 1):
        moved = step_convergence(model, replace(experiment, step_size=step), signals)
        if all(each.relative <= share for each in moved.values()):
            return step
        step /= 2
    return None
