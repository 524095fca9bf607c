"""Runs a compiled formula on trajectories and explains why a trajectory cannot be evaluated."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.errors import MonitorError, did_you_mean
from falsifier.stl.program import Program
from falsifier.stl.steps import run

Floats = NDArray[np.float64]
_TIME_TOLERANCE = 1e-6  # as a fraction of one sampling step


def fill(program: Program, trajectory: Trajectory, buffer: Floats) -> Floats:
    """Evaluate a program on a trajectory; return the buffer with the values of all its parts.

    Args:
        program: the compiled formula.
        trajectory: the trajectory.
        buffer: receives all values, shape (program.size,).

    Raises:
        MonitorError: if the trajectory cannot be evaluated.
    """
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
    uneven = np.absolute(times - program.times)
    if not uneven.max() <= _TIME_TOLERANCE * program.step:
        position = int(np.flatnonzero(~(uneven <= _TIME_TOLERANCE * program.step))[0])
        raise MonitorError(
            f"the time grid is not uniform: recorded time {position} is {times[position]:g} s, expected "
            f"{position * program.step:g} s"
        )
    problem = _run(program, buffer, start)
    if problem:
        raise MonitorError(problem)
    return buffer


def fill_many(program: Program, columns: Mapping[str, Floats]) -> Floats:
    """Evaluate a program on many trajectories; return the robustness of each, shape (m,).

    Args:
        program: the compiled formula.
        columns: samples of all trajectories by signal name, shape (m, n) each.

    Raises:
        MonitorError: naming the first trajectory that cannot be evaluated, and the signal.
    """
    for name in program.signals:
        if name not in columns:
            raise MonitorError(f"no signal {name!r} in the batch; {did_you_mean(name, columns)}")
    used = [np.asarray(columns[name], dtype=np.float64) for name in program.signals]
    shapes = {column.shape for column in columns.values()}
    count = len(next(iter(columns.values()))) if columns else 0
    if shapes != {(count, program.samples)}:
        raise MonitorError(f"expected columns of shape (m, {program.samples}), got {sorted(shapes)}")
    buffer = np.empty((program.size, count))
    n = program.samples
    for i, column in enumerate(used):
        buffer[i * n : (i + 1) * n] = column.T
    if _run(program, buffer, n * len(used)):
        for which in range(count):  # the first one with a problem is named
            alone = np.array(buffer[:, which])
            problem = _run(program, alone, n * len(used))
            if problem:
                raise MonitorError(f"trajectory {which}: {problem}")
    return np.array(buffer[program.root.place.at(0)])


def _run(program: Program, buffer: Floats, signals: int) -> str:
    """Fill a buffer whose first part has the signals; return what is wrong, if anything is."""
    if not np.isfinite(buffer[:signals]).all():
        bad = int(np.flatnonzero(~np.isfinite(buffer[:signals]))[0]) if buffer.ndim == 1 else 0
        signal, sample = divmod(bad, program.samples)
        return f"signal {program.signals[signal]!r} is {buffer[bad]} at {sample * program.step:g} s"
    failed = run(program.steps, buffer)
    return "" if failed < 0 else _problem(program, buffer, failed)


def _problem(program: Program, buffer: Floats, failed: int) -> str:
    n = program.samples
    predicate, place = program.checked[failed]
    if buffer.ndim > 1:
        return f"{predicate} has no finite value"
    margins = buffer[place.at(place.first) : place.at(place.last) + 1]
    sample = place.first + int(np.flatnonzero(~np.isfinite(margins))[0])
    here = {name: buffer[i * n + sample] for i, name in enumerate(program.signals)}
    sides = [side for side in (predicate.left, predicate.right) if side.signals]
    values = ", ".join(f"{side} = {float(side.evaluate(here)):g}" for side in sides)
    return (
        f"{predicate} has no finite value at {sample * program.step:g} s, where {values}; "
        "the operands of /, sqrt, log, exp and ^ must stay in their domain"
    )
