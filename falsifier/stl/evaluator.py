"""Runs a compiled formula on trajectories and explains why a trajectory cannot be evaluated."""

from collections.abc import Mapping
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.errors import MonitorError, did_you_mean
from falsifier.stl.program import Program

Floats = NDArray[np.float64]


def fill(program: Program, trajectory: Trajectory, buffer: Floats) -> Floats:
    """Evaluate a program on a trajectory; return the buffer with the values of all its parts.

    Args:
        program: the compiled formula.
        trajectory: the trajectory.
        buffer: receives all values, shape (program.size,).

    Raises:
        MonitorError: if the trajectory cannot be evaluated.
    """
    kernels = _kernels()
    n, times = program.samples, trajectory.times
    if len(times) != n:
        raise MonitorError(
            f"the trajectory has {len(times)} recorded times, expected {n} from 0 s to "
            f"{(n - 1) * program.step:g} s every {program.step:g} s"
        )
    start = 0
    for name in program.signals:
        buffer[start : start + n] = trajectory[name]
        start += n
    times = np.ascontiguousarray(times, dtype=np.float64)
    status, position = kernels.judge(program.rows, program.numbers, buffer, start, times, program.step)
    if status == kernels.FINE:
        return buffer
    if status == kernels.BAD_TIME:
        raise MonitorError(
            f"the time grid is not uniform: recorded time {position} is {times[position]:g} s, expected "
            f"{position * program.step:g} s"
        )
    raise MonitorError(_problem(program, buffer, status, position))


def fill_many(program: Program, columns: Mapping[str, Floats]) -> Floats:
    """Evaluate a program on many trajectories; return the robustness of each, shape (m,).

    Args:
        program: the compiled formula.
        columns: samples of all trajectories by signal name, shape (m, n) each.

    Raises:
        MonitorError: naming the first trajectory that cannot be evaluated, and the signal.
    """
    kernels = _kernels()
    for name in program.signals:
        if name not in columns:
            raise MonitorError(f"no signal {name!r} in the batch; {did_you_mean(name, columns)}")
    used = [np.asarray(columns[name], dtype=np.float64) for name in program.signals]
    shapes = {column.shape for column in columns.values()}
    count = len(next(iter(columns.values()))) if columns else 0
    if shapes != {(count, program.samples)}:
        raise MonitorError(f"expected columns of shape (m, {program.samples}), got {sorted(shapes)}")
    stacked = np.stack(used) if used else np.empty((0, count, program.samples))
    buffer, result = np.empty(program.size), np.empty(count)
    root = program.root.place.at(0)
    status, which, position = kernels.judge_many(program.rows, program.numbers, buffer, stacked, root, result)
    if status != kernels.FINE:
        raise MonitorError(f"trajectory {which}: {_problem(program, buffer, status, position)}")
    return result


def _kernels() -> ModuleType:
    from falsifier.stl import kernels

    return kernels


def _problem(program: Program, buffer: Floats, status: int, position: int) -> str:
    n = program.samples
    if status == _kernels().BAD_SIGNAL:
        signal, sample = divmod(position, n)
        return f"signal {program.signals[signal]!r} is {buffer[position]} at {sample * program.step:g} s"
    predicate, place = program.checked[position]
    margins = buffer[place.at(place.first) : place.at(place.last) + 1]
    sample = place.first + int(np.flatnonzero(~np.isfinite(margins))[0])
    here = {name: buffer[i * n + sample] for i, name in enumerate(program.signals)}
    sides = [side for side in (predicate.left, predicate.right) if side.signals]
    values = ", ".join(f"{side} = {float(side.evaluate(here)):g}" for side in sides)
    return (
        f"{predicate} has no finite value at {sample * program.step:g} s, where {values}; "
        "the operands of /, sqrt, log, exp and ^ must stay in their domain"
    )
