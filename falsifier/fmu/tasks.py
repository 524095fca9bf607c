"""Simulations of one search, from the process that requests them: inputs in, a trajectory out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from falsifier.core.model import Experiment, ModelInfo, check_finite
from falsifier.core.trajectory import Trajectory
from falsifier.fmu.plan import Plan


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
