"""The monitor: robustness, critical time and diagnosis of a formula on trajectories of one time grid."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.errors import FormulaError, MonitorError
from falsifier.stl.compiler import compile_formula
from falsifier.stl.diagnosis import Diagnosis, diagnose
from falsifier.stl.evaluator import fill, fill_many
from falsifier.stl.formula import Formula
from falsifier.stl.program import Program
from falsifier.stl.verdict import Verdict
from falsifier.stl.witness import trace


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
        object.__setattr__(self, "_spare", [])  # buffers of finished evaluations, to be written over

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel as what it was made from and compile again on arrival."""
        return Monitor, (self.formula, self.step, self.samples)

    def evaluate(self, trajectory: Trajectory) -> Verdict:
        """Robustness at time 0 and what decided it.

        Raises:
            MonitorError: when the trajectory cannot be judged: other time grid, missing signal, NaN or inf.
        """
        buffer = fill(self._program, trajectory, self._take_buffer())
        way = trace(self._program.root, buffer)
        self._spare.append(buffer)
        decider, sample = way[-1].part, way[-1].sample
        time = trajectory.times.item(sample)
        values = {name: float(column.item(sample)) for name, column in trajectory.columns.items()}
        for name, value in values.items():
            if not isfinite(value):
                raise MonitorError(f"signal {name!r} is {value} at {time:g} s")
        return Verdict(way[0].value, time, decider.text, values)

    def diagnose(self, trajectory: Trajectory) -> Diagnosis:
        """Way from the formula to the predicate that decided its value, in words too, and vacuity.

        Raises:
            MonitorError: when the trajectory cannot be judged.
        """
        buffer = fill(self._program, trajectory, self._take_buffer())
        diagnosis = diagnose(self._program.root, buffer, trajectory)
        self._spare.append(buffer)
        return diagnosis

    def robustness(self, trajectory: Trajectory, time: float = 0.0) -> dict[Formula, float]:
        """Robustness of every distinct sub-formula at one time in s.

        Sub-formulas whose windows reach past the end from there are left out; at time 0 there are none.

        Raises:
            MonitorError: when the trajectory cannot be judged or the time lies outside it.
        """
        sample = round(time / self.step)
        if not 0 <= sample < self.samples:
            raise MonitorError(f"{time:g} s lies outside the trajectory, which ends at {self._end:g} s")
        result: dict[Formula, float] = {}
        for part in dict.fromkeys(self.formula.walk()):
            if sample + self._reach(part) < self.samples:
                result[part] = self._values(part, trajectory, sample, sample).item(0)
        return result

    def course(self, trajectory: Trajectory, part: Formula | None = None) -> NDArray[np.float64]:
        """Robustness of a sub-formula, or of the formula, over time.

        Returns:
            One value per sample from time 0 on, as far as the windows do not reach past the end, shape (k,).

        Raises:
            FormulaError: when the part cannot be judged on this grid.
            MonitorError: when the trajectory cannot be judged.
        """
        part = self.formula if part is None else part
        return self._values(part, trajectory, 0, self.samples - 1 - self._reach(part))

    def batch(self, columns: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Robustness at time 0 of many trajectories at once.

        Args:
            columns: samples of all trajectories by signal, shape (m, n) each.

        Returns:
            One robustness per trajectory, shape (m,).

        Raises:
            MonitorError: naming the trajectory and the signal that cannot be judged.
        """
        return fill_many(self._program, columns)

    @property
    def _end(self) -> float:
        return (self.samples - 1) * self.step

    def _take_buffer(self) -> NDArray[np.float64]:
        return self._spare.pop() if self._spare else np.empty(self._program.size)

    def _reach(self, part: Formula) -> int:
        return round(part.horizon(self.step) / self.step)

    def _values(self, part: Formula, trajectory: Trajectory, first: int, last: int) -> NDArray[np.float64]:
        program = compile_formula(part, step=self.step, samples=self.samples, first=first, last=last)
        buffer = fill(program, trajectory, np.empty(program.size))
        return program.root.over(buffer, first, last).copy()
