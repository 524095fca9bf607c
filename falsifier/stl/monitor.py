"""The monitor: robustness, critical time and diagnosis of a formula on trajectories of one time grid."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.errors import FormulaError, MonitorError
from falsifier.stl.formula import Formula
from falsifier.stl.program import Program, compile_formula
from falsifier.stl.verdict import Verdict
from falsifier.stl.witness import Waypoint, trace
from falsifier.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class Monitor:
    """A formula, compiled for one time grid when the monitor is made.

    Attributes:
        formula: the requirement.
        step: sampling step of the trajectories in s.
        samples: their number of samples, both ends included.

    Raises:
        FormulaError: when a window reaches past the end of the grid or a bound is no multiple of the step.
    """

    formula: Formula
    step: float
    samples: int
    _program: Program = field(init=False, repr=False, compare=False)
    _spare: list[NDArray[np.float64]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not (self.step > 0 and np.isfinite(self.step) and self.samples >= 1):
            raise FormulaError(
                f"a time grid needs a positive step and at least one sample, got {self.step}, {self.samples}"
            )
        program = compile_formula(self.formula, step=self.step, samples=self.samples)
        object.__setattr__(self, "_program", program)
        object.__setattr__(self, "_spare", [])

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel as what it was made from and compile again on arrival."""
        return Monitor, (self.formula, self.step, self.samples)

    def evaluate(self, trajectory: Trajectory) -> Verdict:
        """Robustness at time 0 and what decided it.

        Raises:
            MonitorError: when the trajectory cannot be judged: other time grid, missing signal, NaN or inf.
        """
        buffer = self._filled(trajectory)
        way = trace(self._program, buffer)
        self._spare.append(buffer)
        return _verdict(way, trajectory)

    def _filled(self, trajectory: Trajectory) -> NDArray[np.float64]:
        return fill(self._program, trajectory, self._spare.pop() if self._spare else None)


def fill(
    program: Program, trajectory: Trajectory, buffer: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Evaluate a program on a trajectory; return the buffer with the values of all its parts.

    Args:
        program: the compiled formula.
        trajectory: what was simulated.
        buffer: one that may be written over, of an earlier call.

    Raises:
        MonitorError: when the trajectory cannot be judged.
    """
    from falsifier.stl import kernels

    if buffer is None:
        buffer = np.empty(program.size)
    n = program.samples
    if len(trajectory) != n:
        raise MonitorError(
            f"the trajectory has {len(trajectory)} samples, expected {n} from 0 s to "
            f"{(n - 1) * program.step:g} s every {program.step:g} s"
        )
    for i, name in enumerate(program.signals):
        buffer[i * n : (i + 1) * n] = trajectory[name]
    times = np.ascontiguousarray(trajectory.times, dtype=np.float64)
    size = len(program.signals) * n
    status, position = kernels.judge(program.rows, program.numbers, buffer, size, times, program.step)
    if status != kernels.FINE:
        raise _complaint(program, buffer, times, status, position)
    return buffer


def _complaint(
    program: Program, buffer: NDArray[np.float64], times: NDArray[np.float64], status: int, position: int
) -> MonitorError:
    from falsifier.stl import kernels

    if status == kernels.BAD_TIME:
        return MonitorError(
            f"the time grid is not uniform: sample {position} lies at {times[position]:g} s, expected "
            f"{position * program.step:g} s"
        )
    if status == kernels.BAD_SIGNAL:
        signal, sample = divmod(position, program.samples)
        return MonitorError(
            f"signal {program.signals[signal]!r} is {buffer[position]} at {times[sample]:g} s"
        )
    predicate = program.checked[position]
    place = program.places[predicate]
    values = buffer[place.at(place.first) : place.at(place.last) + 1]
    sample = place.first + int(np.flatnonzero(~np.isfinite(values))[0])
    n = program.samples
    known = {name: buffer[i * n + sample] for i, name in enumerate(program.signals)}
    sides = ", ".join(
        f"{side} = {float(side.evaluate(known)):g}"
        for side in (predicate.left, predicate.right)
        if side.signals
    )
    return MonitorError(
        f"{predicate} has no finite value at {times[sample]:g} s, where {sides}; "
        "keep the arguments of /, sqrt, log, exp and ^ where they are defined"
    )


def _verdict(way: list[Waypoint], trajectory: Trajectory) -> Verdict:
    sample = way[-1].sample
    values = {name: column[sample].item() for name, column in trajectory.columns.items()}
    return Verdict(way[0].value, trajectory.times[sample].item(), str(way[-1].formula), values)
