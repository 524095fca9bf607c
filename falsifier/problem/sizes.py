"""Limits of what a simulation may take: beyond them memory would run out, or no simulation would ever end."""

from falsifier.core.model import Experiment
from falsifier.core.space import SearchSpace
from falsifier.errors import SpecError

# Maximum number of steps of each kind per simulation; trajectories have one sample per output interval.
MAX_STEPS = 10_000_000


def check_steps(stop_time: float, period: float | None, *, file: str, key: str) -> None:
    """Check that a period in s divides the stop time into no more than MAX_STEPS steps.

    Raises:
        SpecError: naming the key and the smallest period.
    """
    if period is not None and stop_time / period > MAX_STEPS:
        raise SpecError(
            f"{period:g} s gives more than {MAX_STEPS:,} steps up to the stop time {stop_time:g} s; "
            f"the smallest value is {stop_time / MAX_STEPS:g}",
            file=file,
            key=key,
        )


def check_sizes(experiment: Experiment, space: SearchSpace, file: str) -> None:
    """Check the steps of the solver and of inputs that are sampled and held.

    Raises:
        SpecError: naming the key and the smallest period.
    """
    check_steps(experiment.stop_time, experiment.step_size, file=file, key="model.step_size")
    for r in space.inputs:
        check_steps(experiment.stop_time, r.hold, file=file, key=f"inputs.{r.name}.hold")
