"""The monitor: robustness, critical time and diagnosis of a formula on trajectories with one time grid."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from falsifier.core.arguments import instance, positive, whole
from falsifier.core.fixed import FixedDict
from falsifier.core.trajectory import Trajectory
from falsifier.errors import FormulaError, MonitorError
from falsifier.stl.breach import Breach, find_breach
from falsifier.stl.compiler import compile_formula
from falsifier.stl.diagnosis import Diagnosis, diagnose, path_to_decider
from falsifier.stl.formula import Formula, Implies, Or, Predicate
from falsifier.stl.program import CompiledPart, Program, fill, fill_many

# Maximum number of signals of which a verdict keeps the values, unless the formula has more.
_MOST_VALUES = 40


@dataclass(frozen=True, slots=True)
class Verdict:
    """Robustness of a requirement on one trajectory, and what decided it.

    Attributes:
        robustness: signed margin at time 0; < 0 is a violation, and nothing else is. A margin of exactly 0
            is given as -1e-300 if the requirement is violated, and as 1e-300 if it holds.
        critical_time: time in s that decided the value.
        predicate: text of the deciding predicate.
        values: signal values at the critical time, by name; of more than 40 signals those of the formula, and
            as many others as make 40: there is a verdict for each requirement and simulation.
        breach: what broke; None if nothing did.
    """

    robustness: float
    critical_time: float
    predicate: str
    values: Mapping[str, float] = field(default_factory=dict)
    breach: Breach | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", FixedDict(self.values))

    @property
    def moment(self) -> float:
        """Time in s to look at: when what broke was farthest off; without a violation, the critical time."""
        return self.breach.main.time if self.breach else self.critical_time

    @property
    def violated(self) -> bool:
        """Whether the requirement is violated."""
        return self.robustness < 0


class Extremes(NamedTuple):
    """Smallest and largest robustness of a part of a formula over all samples at which it counts."""

    low: float
    lowest: float  # its time in s
    high: float
    highest: float  # its time in s


@dataclass(frozen=True, slots=True)
class Monitor:
    """A formula, compiled for one time grid when the monitor is created.

    Attributes:
        formula: the formula.
        step: sampling step of the trajectories in s.
        samples: their number of samples, including both ends.
        watched: parts of the formula whose extremes tell whether it was tested: conditions of implications,
            operands of disjunctions, and predicates. Before each, the implication or disjunction to which it
            belongs; for a predicate itself.

    Raises:
        FormulaError: if the formula is not parsed, needs values after the end of the grid, or has a bound
            that is no multiple of the step or a constant without a finite value.
        SpecError: if the step is not positive, or samples is no positive whole number.
    """

    formula: Formula
    step: float
    samples: int
    watched: tuple[tuple[Formula, CompiledPart], ...] = field(init=False, repr=False, compare=False)
    _program: Program = field(init=False, repr=False, compare=False)
    _spare: list[NDArray[np.float64]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not isinstance(self.formula, Formula):
            raise FormulaError(f"a monitor needs a formula; use parse({self.formula!r})")
        positive("step", self.step)
        object.__setattr__(self, "samples", whole("samples", self.samples, least=1))
        program = compile_formula(self.formula, step=self.step, samples=self.samples)
        object.__setattr__(self, "_program", program)
        object.__setattr__(self, "watched", tuple(_watched(program.root)))
        object.__setattr__(self, "_spare", [])  # buffers of earlier evaluations, for reuse

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the arguments only; the formula is compiled again on unpickling."""
        return Monitor, (self.formula, self.step, self.samples)

    def evaluate(self, trajectory: Trajectory) -> Verdict:
        """Return the robustness at time 0 and what decided it.

        Raises:
            MonitorError: if the trajectory cannot be evaluated: other time grid, missing signal, NaN or inf.
        """
        buffer = fill(self._program, trajectory, self._take_buffer())
        path = path_to_decider(self._program.root, buffer)
        robustness = path[0].value
        breach = find_breach(self._program.root, buffer, trajectory) if robustness < 0 else None
        self._spare.append(buffer)
        decider, sample = path[-1].part, path[-1].sample
        time = trajectory.times.item(sample)
        columns, signals = trajectory.columns, self.formula.signals
        names = list(columns)
        if len(names) > _MOST_VALUES:
            names = [*dict.fromkeys((*signals, *names))][: max(_MOST_VALUES, len(signals))]
        values = {name: float(columns[name].item(sample)) for name in names}
        for name, value in values.items():
            if not isfinite(value):
                raise MonitorError(f"signal {name!r} is {value} at {time:g} s")
        return Verdict(robustness, time, decider.text, values, breach)

    def diagnose(self, trajectory: Trajectory) -> Diagnosis:
        """Return the path from the formula to the deciding predicate, and the vacuous implications.

        Raises:
            MonitorError: if the trajectory cannot be evaluated.
        """
        buffer = fill(self._program, trajectory, self._take_buffer())
        diagnosis = diagnose(self._program.root, buffer, trajectory)
        self._spare.append(buffer)
        return diagnosis

    def extremes(self, trajectory: Trajectory) -> list[Extremes]:
        """Return the smallest and largest robustness of each watched part.

        Raises:
            MonitorError: if the trajectory cannot be evaluated.
        """
        buffer = fill(self._program, trajectory, self._take_buffer())
        found = []
        for _, part in self.watched:
            first, last = part.location.first, part.location.last
            values = part.over(buffer, first, last)
            low, high = int(values.argmin()), int(values.argmax())
            lowest, highest = (first + low) * self.step, (first + high) * self.step
            found.append(Extremes(values.item(low), lowest, values.item(high), highest))
        self._spare.append(buffer)
        return found

    def course(self, trajectory: Trajectory, part: Formula | None = None) -> NDArray[np.float64]:
        """Return the robustness over time of a sub-formula, or of the whole formula.

        Returns:
            One value per sample from time 0 to the last sample from which all windows fit, shape (k,).

        Raises:
            FormulaError: if the part cannot be evaluated on this grid.
            MonitorError: if the trajectory cannot be evaluated.
        """
        part = self.formula if part is None else part
        last = max(self.samples - 1 - round(part.horizon(self.step) / self.step), 0)
        program = compile_formula(part, step=self.step, samples=self.samples, last=last)
        return program.root.over(fill(program, trajectory, np.empty(program.size)), 0, last).copy()

    def courses(self, trajectory: Trajectory) -> dict[Formula, NDArray[np.float64]]:
        """Return the robustness over time of every distinct sub-formula, where it matters to that at time 0.

        Returns:
            One value per sample, shape (samples,) each; NaN at times at which it does not matter, where it
            may have no value.

        Raises:
            MonitorError: if the trajectory cannot be evaluated.
        """
        buffer = fill(self._program, trajectory, self._take_buffer())
        found: dict[Formula, NDArray[np.float64]] = {}
        for part in self._program.root.walk():
            first, last = part.location.first, part.location.last
            course = found.setdefault(part.formula, np.full(self.samples, np.nan))
            course[first : last + 1] = part.over(buffer, first, last)
        self._spare.append(buffer)
        return found

    def batch(self, columns: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the robustness at time 0 of many trajectories at once.

        Args:
            columns: samples of all trajectories by signal name, shape (m, n) each.

        Returns:
            One robustness per trajectory, shape (m,).

        Raises:
            MonitorError: naming the first trajectory that cannot be evaluated, and the signal.
        """
        instance("columns", columns, Mapping, "arrays by signal name, each with a row per trajectory")
        return fill_many(self._program, columns)

    def _take_buffer(self) -> NDArray[np.float64]:
        return self._spare.pop() if self._spare else np.empty(self._program.size)


def _watched(root: CompiledPart) -> Iterator[tuple[Formula, CompiledPart]]:
    for part in root.walk():
        match part.formula:
            case Implies():
                yield part.formula, part.children[0]
            case Or():
                yield from ((part.formula, child) for child in part.children)
            case Predicate():
                yield part.formula, part
