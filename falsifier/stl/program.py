"""A compiled formula: its steps over one flat buffer, the place of each part's values, and running it."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.errors import MonitorError, did_you_mean
from falsifier.stl.formula import Formula, Predicate

Floats = NDArray[np.float64]
_TIME_TOLERANCE = 1e-6  # as a fraction of one sampling step
# Changes a buffer; returns whether a checked value is not finite.
Operation = Callable[[Floats], bool]
# Makes a step from the parts that it writes and reads, and two numbers. The first operand of a sliding window
# is longer than the result by the number of samples of the window after its first.
Maker = Callable[[slice, slice, slice, float, float], Operation]


def run(steps: tuple[Operation, ...], buffer: Floats) -> int:
    """Run all steps; return the number of the one whose check fails, after which no other is run, or -1."""
    with np.errstate(all="ignore"):  # what is not finite is found by the checks
        for number, step in enumerate(steps):
            if step(buffer):
                return number
    return -1


def _binary(function: np.ufunc) -> Maker:
    def make(out: slice, a: slice, b: slice, _p: float, _q: float) -> Operation:
        def step(x: Floats) -> bool:
            function(x[a], x[b], out=x[out])
            return False

        return step

    return make


def _unary(function: np.ufunc) -> Maker:
    def make(out: slice, a: slice, _b: slice, _p: float, _q: float) -> Operation:
        def step(x: Floats) -> bool:
            function(x[a], out=x[out])
            return False

        return step

    return make


def _filling(values: Callable[..., Any]) -> Maker:
    """Make steps whose values are calculated from operands, length and numbers."""

    def make(out: slice, a: slice, b: slice, p: float, q: float) -> Operation:
        length = out.stop - out.start

        def step(x: Floats) -> bool:
            x[out] = values(x[a], x[b], length, p, q)
            return False

        return step

    return make


def _check(_out: slice, a: slice, _b: slice, p: float, _q: float) -> Operation:
    def step(x: Floats) -> bool:
        margins = x[a]
        if not margins.all():
            margins[margins == 0.0] = p
        return not np.isfinite(margins).all()

    return step


def _window(extreme: np.ufunc) -> Maker:
    def values(a: Floats, _b: Floats, length: int, _p: float, _q: float) -> Floats:
        width = len(a) - length + 1
        if length == 1:
            return np.asarray(extreme.reduce(a, axis=0))
        covered = 1
        while 2 * covered <= width:
            a = extreme(a[:-covered], a[covered:])
            covered *= 2
        rest = width - covered
        return np.asarray(extreme(a[:length], a[rest : rest + length]))

    return _filling(values)


def _rest(extreme: np.ufunc) -> Maker:
    return _filling(lambda a, _b, _length, _p, _q: extreme.accumulate(a[::-1], axis=0)[::-1])


def _until(a: Floats, b: Floats, _length: int, _p: float, _q: float) -> Floats:
    """Return ``max(b[i], min(a[i], result[i + 1]))``, from the last sample, where it is b, to the first.

    Each sample limits what follows to an interval, and limits one after the other are an interval again:
    those of 1, 2, 4, ... samples are combined.
    """
    low, high = b.copy(), np.maximum(a, b)
    high[-1] = low[-1]
    distance = 1
    while distance < len(a):
        here, there = slice(None, -distance), slice(distance, None)
        below = np.maximum(low[here], np.minimum(high[here], low[there]))
        high[here] = np.maximum(low[here], np.minimum(high[here], high[there]))
        low[here] = below
        distance *= 2
    return low


ADD, SUBTRACT, MULTIPLY = _binary(np.add), _binary(np.subtract), _binary(np.multiply)
DIVIDE, POWER = _binary(np.divide), _binary(np.power)
MINIMUM, MAXIMUM = _binary(np.minimum), _binary(np.maximum)
ABS, SQRT, EXP, LOG = _unary(np.absolute), _unary(np.sqrt), _unary(np.exp), _unary(np.log)
SIN, COS = _unary(np.sin), _unary(np.cos)
SCALE = _filling(lambda a, _b, _length, p, q: p * a + q if q else p * a)
FILL = _filling(lambda _a, _b, _length, _p, q: q)
WINDOW_MINIMUM, WINDOW_MAXIMUM = _window(np.minimum), _window(np.maximum)
REST_MINIMUM, REST_MAXIMUM = _rest(np.minimum), _rest(np.maximum)
UNTIL = _filling(_until)
CHECK: Maker = _check  # stops unless the first operand is finite; where it is 0, it becomes the first number


@dataclass(frozen=True, slots=True)
class Place:
    """Location of one part's values in the buffer.

    Attributes:
        base: the value at sample k has the offset ``base + k``.
        first: first computed sample.
        last: last computed sample.
    """

    base: int
    first: int
    last: int

    def at(self, sample: int) -> int:
        """Return the offset in the buffer of the value at this sample."""
        return self.base + sample


@dataclass(frozen=True, slots=True)
class Part:
    """A sub-formula and the location of its values.

    Attributes:
        formula: the sub-formula.
        text: its text.
        place: its samples and their offsets.
        window: window of a temporal operator, in samples from the sample at which it is evaluated; an end of
            None is the last sample of the trajectory.
        samples: number of samples of one trajectory.
        children: parts directly below.
    """

    formula: Formula
    text: str
    place: Place
    window: tuple[int, int | None] | None
    samples: int
    children: tuple["Part", ...]

    def at(self, buffer: NDArray[np.float64], sample: int) -> float:
        """Return the robustness at a sample."""
        return buffer.item(self.place.base + sample)

    def over(self, buffer: NDArray[np.float64], first: int, last: int) -> NDArray[np.float64]:
        """Return the robustness at the samples from first to last inclusive."""
        return buffer[self.place.base + first : self.place.base + last + 1]

    def window_at(self, sample: int) -> tuple[int, int] | None:
        """Return the first and last sample of a temporal operator's window if evaluated at this sample."""
        if self.window is None:
            return None
        start, end = self.window
        return sample + start, self.samples - 1 if end is None else sample + end

    def walk(self) -> Iterator["Part"]:
        """Yield this part and all below it, from left to right."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True, slots=True)
class Program:
    """Steps, and the place of each part's values.

    Attributes:
        root: the whole formula.
        signals: names of the signals, in their order in the buffer.
        step: sampling step in s.
        samples: number of samples of one trajectory.
        times: the time grid in s, shape (n,).
        steps: what fills the buffer, in order.
        size: length of the buffer.
        checked: the predicate that each check is for, and its place, by the number of the step.
    """

    root: Part
    signals: tuple[str, ...]
    step: float
    samples: int
    times: NDArray[np.float64]
    steps: tuple[Operation, ...]
    size: int
    checked: dict[int, tuple[Predicate, Place]]


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
