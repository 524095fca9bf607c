"""What all simulations of one search have in common, checked once; inputs in, a trajectory out."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from falsifier.core.model import GRID_ROUNDING, Experiment, ModelInfo, check_finite
from falsifier.core.trajectory import Trajectory
from falsifier.errors import ModelError, SpecError, did_you_mean
from falsifier.fmu.description import Description

_DEFAULT_TOLERANCE = 1e-6
_DEFAULT_TIME_LIMIT = 60.0


@dataclass(frozen=True, slots=True)
class Plan:
    """What all simulations of a search have in common.

    Attributes:
        inputs: names of the inputs that are set, in the order of their rows.
        parameters: names of the parameters and start values that are set.
        outputs: names of the recorded variables, in the order of their rows.
        stop_time: stop time in s.
        samples: number of points of the output grid.
        every: communication steps per output interval (co-simulation).
        pieces: maximum number of pieces of an input, see ``Signal.pieces``.
        max_step: maximum step of the solver in s (model exchange).
        tolerance: relative tolerance; None for the model's default.
        time_limit: maximum wall-clock time of one simulation in s.
        has_limit: whether that is for the whole simulation; else for each tenth of the simulated time, so
            that slow models are simulated, and those that hang are ended.
        strings: names and values of string parameters.
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
    strings: tuple[tuple[str, str], ...] = ()
    has_limit: bool = True

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return (self.samples - 1) * self.every


def solver_tolerance(plan: Plan, info: ModelInfo) -> float:
    """Return the relative tolerance of the solver (model exchange)."""
    return plan.tolerance or info.tolerance or _DEFAULT_TOLERANCE


def make_plan(
    description: Description,
    experiment: Experiment,
    inputs: Iterable[str],
    parameters: Iterable[str],
    *,
    pieces: int = 1,
) -> Plan:
    """Look up and check what the simulations of a search have in common.

    Raises:
        ModelError: naming a variable that the model does not have or that cannot be set or recorded.
        SpecError: if the steps and the stop time are not multiples of each other.
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
        time_limit=experiment.time_limit or _DEFAULT_TIME_LIMIT,
        strings=experiment.strings,
        has_limit=experiment.time_limit is not None,
    )
    model = description.info.name
    kinds = {v.name: v for v in description.info.variables}
    for name in plan.inputs:
        description.slot(name)
        if kinds[name].causality != "input":
            known = ", ".join(v.name for v in description.info.inputs) or "none"
            role = kinds[name].causality
            raise ModelError(
                f"{model}: {name!r} is not an input, its causality is {role}; the inputs are: {known}"
            )
    for name in plan.parameters:
        slot = description.slot(name)
        if slot.refusal:
            raise ModelError(f"{model}: {name!r} cannot be set: {slot.refusal}")
    for name in plan.outputs:
        description.slot(name)
    for name, _ in plan.strings:
        _check_string(description, name)
    return plan


def _check_string(description: Description, name: str) -> None:
    model, slot = description.info.name, description.slots.get(name)
    if slot is None:
        raise ModelError(f"{model}: no variable {name!r}; {did_you_mean(name, description.slots)}")
    if slot.refusal or slot.type != "String" or slot.size != 1:
        reason = slot.refusal or "it is not a single string"
        raise ModelError(f"{model}: {name!r} cannot be set to a text: {reason}")


def _steps_per_output(experiment: Experiment) -> int:
    interval, step = experiment.output_interval, experiment.step_size
    if step is None:
        return 1
    count = max(round(interval / step), 1)
    if abs(interval / step - count) > GRID_ROUNDING * count:
        raise SpecError(
            f"output_interval = {interval:g} s is not an integer multiple of step_size = {step:g} s; "
            f"try step_size = {interval / count:g}",
            key="step_size",
        )
    return count


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """What the simulations of one search share in the process that requests them.

    Attributes:
        plan: what the worker needs to know.
        times: the trajectory's time grid in s.
        units: units of the outputs by name.
    """

    plan: Plan
    times: NDArray[np.float64]
    units: Mapping[str, str]


class _Simulates(Protocol):
    def simulate(
        self, plan: Plan, fill: Callable[[Any], None]
    ) -> tuple[NDArray[np.float64], tuple[str, ...]]: ...


def make_task(plan: Plan, experiment: Experiment, info: ModelInfo) -> Task:
    """Return the task of a plan."""
    times = experiment.times
    times.flags.writeable = False
    units = {v.name: v.unit for v in info.variables if v.unit and v.name in plan.outputs}
    return Task(plan, times, units)


def room_for(tables: Sequence[NDArray[np.float64]]) -> int:
    """Return the number of pieces per input to plan for.

    Rounded up to a power of two, so that a few plans suffice for candidates with any number of control
    points.
    """
    pieces = max(map(len, tables), default=1)
    return 1 << (pieces - 1).bit_length()


def run_task(
    runner: _Simulates,
    task: Task,
    tables: Sequence[NDArray[np.float64]],
    parameters: Mapping[str, float],
    name: str,
) -> Trajectory:
    """Simulate once.

    Args:
        runner: what simulates.
        task: what the simulations have in common.
        tables: each input as a piecewise cubic (``Signal.pieces``), in the plan's order.
        parameters: values, in the plan's order.
        name: name of the model, for errors.

    Raises:
        SimulationError: if there is no complete trajectory of finite numbers.
        ModelError: if the model cannot be used.
    """

    def fill(room: Any) -> None:
        if parameters:
            room.parameters[:] = list(parameters.values())
        for row, table in zip(room.inputs, tables, strict=True):
            row[: table.size] = table.ravel()
            row[table.size :] = np.inf

    outputs, log = runner.simulate(task.plan, fill)
    columns = dict(zip(task.plan.outputs, outputs, strict=True))
    if not np.isfinite(outputs).all():
        check_finite(name, task.times, columns)
    return Trajectory(task.times, columns, task.units, log)
