"""One kind of simulation of one FMU: names looked up and refused once, before the first run."""

from collections.abc import Iterable
from dataclasses import dataclass

from falsifier.core.model import Experiment
from falsifier.errors import ModelError, SpecError
from falsifier.fmu.description import Description

# How far a ratio of two steps may lie from a whole number and still mean it.
_RATIO_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Plan:
    """What is common to all simulations of a search.

    Attributes:
        inputs: names of the driven inputs, in the order of their rows.
        parameters: names of the parameters and start values that are set.
        outputs: names of the recorded variables, in the order of their rows.
        stop_time: end in s.
        samples: number of points of the output grid.
        every: communication steps per output interval (co-simulation).
        pieces: room for this many pieces of each input, see Signal.pieces.
        max_step: largest step of the solver in s (model exchange).
        tolerance: relative tolerance, None for the model's own.
        time_limit: wall-clock seconds for one simulation.
    """

    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    outputs: tuple[str, ...]
    stop_time: float
    samples: int
    every: int
    pieces: int
    max_step: float
    tolerance: float | None
    time_limit: float

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return (self.samples - 1) * self.every


def make_plan(
    description: Description,
    experiment: Experiment,
    inputs: Iterable[str],
    parameters: Iterable[str],
    *,
    pieces: int = 1,
) -> Plan:
    """Look up and check everything that the simulations of a search have in common.

    Raises:
        ModelError: for names that the model does not have or that cannot be driven, set or recorded.
        SpecError: when the steps do not fit each other.
    """
    plan = Plan(
        inputs=tuple(inputs),
        parameters=tuple(parameters),
        outputs=experiment.outputs,
        stop_time=experiment.stop_time,
        samples=experiment.samples,
        every=_steps_per_output(experiment),
        pieces=pieces,
        max_step=experiment.step_size or experiment.output_interval,
        tolerance=experiment.tolerance,
        time_limit=experiment.time_limit,
    )
    model = description.info.name
    kinds = {v.name: v for v in description.info.variables}
    for name in plan.inputs:
        description.slot(name)
        if kinds[name].causality != "input":
            known = ", ".join(v.name for v in description.info.inputs) or "none"
            role = kinds[name].causality
            raise ModelError(
                f"{model}: {name!r} is not an input (its causality is {role}); inputs are: {known}"
            )
    for name in plan.parameters:
        slot = description.slot(name)
        if slot.refusal:
            raise ModelError(f"{model}: {name!r} cannot be set: {slot.refusal}")
    for name in plan.outputs:
        description.slot(name)
    return plan


def _steps_per_output(experiment: Experiment) -> int:
    interval, stop = experiment.output_interval, experiment.stop_time
    if not 0 < interval <= stop * (1 + _RATIO_ROUNDING):
        raise SpecError(
            f"expected 0 < output_interval <= stop_time, got {interval:g} s and {stop:g} s",
            key="output_interval",
        )
    _whole("stop_time", stop, "output_interval", interval)
    if experiment.step_size is None:
        return 1
    return _whole("output_interval", interval, "step_size", experiment.step_size)


def _whole(what: str, total: float, key: str, part: float) -> int:
    ratio = total / part if part > 0 else 0.0
    count = round(ratio)
    if count < 1 or abs(ratio - count) > _RATIO_ROUNDING * count:
        raise SpecError(
            f"{what} = {total:g} s is not a whole multiple of {key} = {part:g} s; "
            f"try {total / max(count, 1):g}",
            key=key,
        )
    return count
