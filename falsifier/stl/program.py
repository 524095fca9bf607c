"""A compiled formula: its steps over one flat buffer, the location of each part's values, and running it."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import TIME_TOLERANCE, Trajectory
from falsifier.core.words import counted, readable
from falsifier.errors import MonitorError, did_you_mean
from falsifier.stl.formula import Formula, Predicate

Floats = NDArray[np.float64]
# Changes a buffer; returns whether a checked value is not finite.
Operation = Callable[[Floats], bool]
# Fills ``out`` from none, one or two operands. The first operand of a sliding window is longer than the
# result by the number of samples of the window after its first.
Function = Callable[..., object]


def calculating(function: Function, out: slice, *operands: slice) -> Operation:
    """Return the step that fills a part of the buffer from others."""
    a, b = (*operands, None, None)[:2]  # apart by their number: a loop over them would take time in each step

    def constant(x: Floats) -> bool:
        function(out=x[out])
        return False

    def unary(x: Floats) -> bool:
        function(x[a], out=x[out])
        return False

    def binary(x: Floats) -> bool:
        function(x[a], x[b], out=x[out])
        return False

    return (constant, unary, binary)[len(operands)]


def checking(margins: slice, at_zero: float, idle: NDArray[np.bool_]) -> Operation:
    """Return the step that stops unless margins are finite; where one is 0, it becomes another number.

    Those that are idle do not matter: what is not finite there becomes any number.
    """

    def step(x: Floats) -> bool:
        found = x[margins]
        if not found.all():
            found[found == 0.0] = at_zero
        if np.isfinite(found).all():
            return False
        found[idle] = at_zero
        return not np.isfinite(found).all()

    return step


def constant(value: float) -> Function:
    """Return the function that is one number everywhere."""
    return lambda out: out.fill(value)


def scaled(factor: float, offset: float = 0.0) -> Function:
    """Return the function ``factor * a + offset``."""

    def function(a: Floats, out: Floats) -> None:
        np.multiply(factor, a, out=out)
        if offset:
            np.add(out, offset, out=out)

    return function


def window(extreme: np.ufunc) -> Function:
    """Return the minimum or maximum over a sliding window, whose width is doubled until it is reached."""

    def function(a: Floats, out: Floats) -> None:
        length = len(out)
        width = len(a) - length + 1
        if length == 1:
            out[...] = extreme.reduce(a, axis=0)
            return
        covered = 1
        while 2 * covered <= width:
            a = extreme(a[:-covered], a[covered:])
            covered *= 2
        rest = width - covered
        extreme(a[:length], a[rest : rest + length], out=out)

    return function


def rest(extreme: np.ufunc) -> Function:
    """Return the minimum or maximum from each sample to the last one."""

    def function(a: Floats, out: Floats) -> None:
        out[...] = extreme.accumulate(a[::-1], axis=0)[::-1]

    return function


def until(a: Floats, b: Floats, out: Floats) -> None:
    """Calculate ``max(b[i], min(a[i], result[i + 1]))``, from the last sample, where it is b, to the first.

    Each sample limits what follows to an interval, and limits one after the other are an interval again:
    those of 1, 2, 4, ... samples are combined.
    """
    out[...] = b
    high = np.maximum(a, b)
    high[-1] = out[-1]
    distance = 1
    while distance < len(a):
        here, there = slice(None, -distance), slice(distance, None)
        below = np.maximum(out[here], np.minimum(high[here], out[there]))
        high[here] = np.maximum(out[here], np.minimum(high[here], high[there]))
        out[here] = below
        distance *= 2


@dataclass(frozen=True, slots=True)
class Location:
    """Location of one part's values in the buffer."""

    base: int  # the value at sample k has the offset ``base + k``
    first: int  # first computed sample
    last: int  # last computed sample

    def at(self, sample: int) -> int:
        """Return the offset in the buffer of the value at this sample."""
        return self.base + sample

    def later(self, samples: int) -> "Location":
        """Return the location in which each sample has the value of one that many samples later."""
        return Location(self.base + samples, self.first - samples, self.last - samples)


@dataclass(frozen=True, slots=True)
class CompiledPart:
    """A sub-formula and the location of its values."""

    formula: Formula  # the sub-formula
    text: str  # its text
    location: Location  # the samples at which it counts here, and their offsets
    # Window of a temporal operator, in samples from the sample at which it is evaluated; an end of None is
    # the last sample of the trajectory.
    window: tuple[int, int | None] | None
    samples: int  # number of samples of one trajectory
    children: tuple["CompiledPart", ...]  # parts directly below

    def at(self, buffer: Floats, sample: int) -> float:
        """Return the robustness at a sample."""
        return buffer.item(self.location.base + sample)

    def over(self, buffer: Floats, first: int, last: int) -> Floats:
        """Return the robustness at the samples from first to last inclusive."""
        return buffer[self.location.base + first : self.location.base + last + 1]

    def window_at(self, sample: int) -> tuple[int, int] | None:
        """Return the first and last sample of a temporal operator's window if evaluated at this sample."""
        if self.window is None:
            return None
        start, end = self.window
        return sample + start, self.samples - 1 if end is None else sample + end

    def walk(self) -> Iterator["CompiledPart"]:
        """Yield this part and all below it, from left to right."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True, slots=True)
class Program:
    """Steps, and the location of each part's values."""

    root: CompiledPart  # the whole formula
    signals: tuple[str, ...]  # names of the signals, in their order in the buffer
    step: float  # sampling step in s
    samples: int  # number of samples of one trajectory
    steps: tuple[Operation, ...]  # what fills the buffer, in order
    size: int  # length of the buffer
    # The predicate that each check is for, and its location, by the number of the step.
    checked: dict[int, tuple[Predicate, Location]]


def fill(program: Program, trajectory: Trajectory, buffer: Floats) -> Floats:
    """Return all values of a program on a trajectory, shape (program.size,); MonitorError if it has none."""
    n, end = program.samples, (program.samples - 1) * program.step
    last = float(trajectory.times[-1])
    if len(trajectory) != n or abs(last - end) > TIME_TOLERANCE * program.step:
        raise MonitorError(
            f"the trajectory has {counted(len(trajectory), 'recorded time')} up to {readable(last)} s, "
            f"expected {n} up to {readable(end)} s, one every {program.step:g} s"
        )
    start = 0
    for name in program.signals:
        buffer[start : start + n] = trajectory[name]
        start += n
    problem = _run(program, buffer, start)
    if problem:
        raise MonitorError(problem)
    return buffer


def fill_many(program: Program, columns: Mapping[str, Floats]) -> Floats:
    """Evaluate a program on many trajectories; return the robustness of each, shape (m,).

    The columns are the samples of all trajectories by signal name, shape (m, n) each.

    Raises:
        MonitorError: naming the first trajectory that cannot be evaluated, and the signal.
    """
    for name in program.signals:
        if name not in columns:
            raise MonitorError(f"no signal {name!r} in the batch; {did_you_mean(name, columns)}")
    used = [np.asarray(columns[name], dtype=np.float64) for name in program.signals]
    shapes = {np.shape(column) for column in columns.values()}
    if len(shapes) != 1 or {shape[1:] for shape in shapes} != {(program.samples,)}:
        raise MonitorError(f"expected columns of shape (m, {program.samples}), got {sorted(shapes)}")
    ((count, _),) = shapes
    buffer = np.empty((program.size, count))
    n = program.samples
    for i, column in enumerate(used):
        buffer[i * n : (i + 1) * n] = column.T
    if _run(program, buffer, n * len(used)):
        for which in range(count):  # the first one with a problem is named
            problem = _run(program, np.array(buffer[:, which]), n * len(used))
            if problem:
                raise MonitorError(f"trajectory {which}: {problem}")
    return np.array(buffer[program.root.location.at(0)])


def _run(program: Program, buffer: Floats, signals: int) -> str:
    """Fill a buffer whose first part has the signals; return what is wrong, if anything is."""
    if not np.isfinite(buffer[:signals]).all():
        bad = int(np.flatnonzero(~np.isfinite(buffer[:signals]))[0]) if buffer.ndim == 1 else 0
        signal, sample = divmod(bad, program.samples)
        return f"signal {program.signals[signal]!r} is {buffer[bad]} at {readable(sample * program.step)} s"
    with np.errstate(all="ignore"):  # what is not finite is found by the checks
        for number, step in enumerate(program.steps):
            if step(buffer):
                return _problem(program, buffer, *program.checked[number])
    return ""


def _problem(program: Program, buffer: Floats, predicate: Predicate, location: Location) -> str:
    if buffer.ndim > 1:
        return f"{predicate} has no finite value"
    margins = buffer[location.at(location.first) : location.at(location.last + 1)]
    sample = location.first + int(np.flatnonzero(~np.isfinite(margins))[0])
    here = {name: buffer[i * program.samples + sample] for i, name in enumerate(program.signals)}
    sides = [side for side in predicate.sides if side.signals]
    values = ", ".join(f"{side} = {float(side.evaluate(here)):g}" for side in sides)
    return (
        f"{predicate} has no finite value at {readable(sample * program.step)} s, where {values}; "
        "the operands of /, sqrt, log, exp and ^ must stay in their domain, also where a condition of the "
        "formula is false: write x/max(y, 0.001), for example"
    )
