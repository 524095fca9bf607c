"""Inputs as short programs: pieces that hold a value for some time, and changes of such programs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.engines.layout import Array, Layout

# Discrete inputs with more values than this are drawn like real ones.
_MAX_LEVELS = 32
# Share of pieces of a real input that are at a bound.
_AT_BOUND = 0.6
# Where an input has few control points, or few values, the probability that all are drawn, each by itself.
_INDEPENDENT = 0.5
# Share of inputs that keep their value in a new tail, if there are several.
_KEPT = 0.25
# If levels are known at which something changes: share of values between or at these.
_AIMED = 0.7
# Of these, the share that is exactly at a level.
_EXACT = 0.15
# Share of a held real input's new values that are ones at which something happened before; how many are kept.
_TELLING, _MOST_TELLING = 0.5, 64
# Probability that a parameter is drawn again: nothing of what followed is certain then.
_PARAMETER_REDRAWN = 0.1


@dataclass(slots=True, eq=False)
class KeptInput:
    """An input that is kept for what it reached first, or sooner than others."""

    point: Array  # the input in the layout
    time: float  # when it was there, in s
    tries: int = 0  # how often the search has gone on from here


class Programs:
    """Draws programs in a layout.

    Args:
        layout: the layout of the points.
        levels: values at which something changes, by the names of inputs and parameters; between any two
            neighbours a system may behave in its own way, however close they are.
    """

    def __init__(self, layout: Layout, levels: Mapping[str, Sequence[float]] = MappingProxyType({})) -> None:
        self._layout = layout
        self._levels = [_levels(r) for r in layout.space.ranges]
        self._cuts = [_cuts(r, levels.get(r.name, ())) for r in layout.space.ranges]
        self._telling: list[list[float]] = [[] for _ in layout.space.ranges]
        # Slices, so that what is written to the values of a group is written to the point.
        self._groups = [slice(int(group[0]), int(group[-1]) + 1) for group in layout.groups]
        self._times = [np.asarray(coding.times) for coding in layout.codings]
        self._longest = max((len(times) for times in self._times), default=1)
        steps = [float(np.diff(times).min()) for times in self._times if len(times) > 1]
        self._step = min(steps, default=1.0)  # shortest time in s between two control points
        self._end = max((float(times[-1]) for times in self._times), default=0.0)  # the last one's

    @property
    def has_inputs(self) -> bool:
        """Whether anything is an input over time."""
        return bool(self._times)

    def remember(self, point: Array, time: float, interval: float) -> None:
        """Remember the values that held real inputs had when something happened, except bounds.

        Args:
            point: the program, shape (d,).
            time: when it was seen, in s.
            interval: time in s between two outputs: it may have happened so much earlier.
        """
        for j, times in enumerate(self._times):
            if self._levels[j] is not None or self._layout.codings[j].interpolation != "constant":
                continue
            known, values = self._telling[j], point[self._groups[j]]
            for at in (time - interval, time):
                value = float(values[max(0, int(np.searchsorted(times, at, side="right")) - 1)])
                if 0.0 < value < 1.0 and value not in known:
                    known.append(value)
            del known[:-_MOST_TELLING]

    def fresh(self, rng: np.random.Generator) -> Array:
        """Return a new program, shape (d,)."""
        point = rng.random(self._layout.dimension)
        for j, group in enumerate(self._groups):
            point[group] = self._level(rng, j, None)
        return self.another_end(rng, point, -1.0)

    def another_end(self, rng: np.random.Generator, point: Array, time: float) -> Array:
        """Return the program that is the same up to a time in s, and drawn again after it."""
        point = self._parameters(rng, point)
        pace = float(np.exp(rng.uniform(0.0, np.log(max(self._longest, 2)))))
        is_independent, are_few = rng.random() < _INDEPENDENT, not any(self._layout.is_fine)
        for j in self._moving(rng):
            start = int(np.searchsorted(self._times[j], time, side="right"))
            one_by_one = is_independent and (are_few or self._levels[j] is not None)
            self._fill(rng, j, point[self._groups[j]], start, 0.5 if one_by_one else pace)
        return point

    def repeated(
        self, rng: np.random.Generator, point: Array, time: float, source: Array, span: tuple[float, float]
    ) -> Array:
        """Return the program that is the same up to a time, followed after a pause by a span of another one.

        Programs have shape (d,); ``span`` is start and end in s of what is taken from ``source``.
        """
        result = self._parameters(rng, point)
        pause = float(np.exp(rng.uniform(0.0, np.log(max(self._longest, 2))))) - 1.0
        for j, times in enumerate(self._times):
            group = self._groups[j]
            first, stop = (int(np.searchsorted(times, t, side="left")) for t in span)
            start = int(np.searchsorted(times, time, side="right"))
            begin = min(len(times), start + round(pause))
            piece = source[group][first : max(stop, first + 1) + 1][: len(times) - begin]
            values = result[group]
            if start < begin:
                values[start:begin] = (
                    values[start - 1] if start and rng.random() < 0.5 else self._level(rng, j, None)
                )
            values[begin : begin + len(piece)] = piece
            values[begin + len(piece) :] = values[begin + len(piece) - 1]
        return result

    def again(self, rng: np.random.Generator, point: Array, time: float, length: float) -> Array:
        """Return the program that repeats what it did in the ``length`` s before a time until the end.

        What made a counter count once may do so as often as it is done.
        """
        result = self._parameters(rng, point)
        for times, group in zip(self._times, self._groups, strict=False):
            first, stop = (int(np.searchsorted(times, t, side="right")) for t in (time - length, time))
            first = min(max(first, 0), max(stop - 1, 0))
            span = max(stop - first, 1)
            values = result[group]
            values[stop:] = values[first + np.arange(len(values) - stop) % span]
        return result

    def tried_again(self, rng: np.random.Generator, point: Array, time: float, length: float) -> Array:
        """Return the program that does something else, then what it did before a time, again and again.

        What it did before is that of ``length`` s; something else takes as long at most.

        A step that is wrong often leads back to where the way began: one simulation tries several.
        """
        result, moving = self._parameters(rng, point), self._moving(rng)
        length = max(length, self._step)
        while time < self._end:
            longest = max(self._step, min(length, (self._end - time) / 2.0))
            back = time + float(np.exp(rng.uniform(np.log(self._step), np.log(longest))))
            for j, (times, group) in enumerate(zip(self._times, self._groups, strict=False)):
                start, stop, end = np.searchsorted(times, (time, back, back + length), side="right")
                values = result[group]
                last = float(values[start - 1]) if start else None
                values[start:stop] = (
                    last if last is not None and j not in moving else self._level(rng, j, last)
                )
                first = int(np.searchsorted(times, time - length, side="right"))
                values[stop:end] = values[first : first + end - stop].copy()
            time = back + length
        return result

    def sooner(self, rng: np.random.Generator, point: Array, time: float) -> tuple[Array, float]:
        """Return the program without a stretch before a time, and that time in it: the rest comes sooner."""
        result = point.copy()
        begin = float(rng.uniform(0.0, time))
        cut = float((time - begin) * rng.random() ** 2)
        for times, group in zip(self._times, self._groups, strict=False):
            first, stop = (int(np.searchsorted(times, t, side="left")) for t in (begin, begin + cut))
            values = result[group]
            moved = len(values) - stop
            values[first : first + moved] = values[stop:].copy()
        return result, time - cut

    def _moving(self, rng: np.random.Generator) -> list[int]:
        """Draw the inputs that do not keep their values, at least one if there are inputs."""
        moving = rng.random(len(self._times)) >= _KEPT
        if moving.size:
            moving[rng.integers(len(moving))] = True
        return np.flatnonzero(moving).tolist()

    def _parameters(self, rng: np.random.Generator, point: Array) -> Array:
        point = point.copy()
        for j in range(len(self._times), len(self._groups)):
            if not self._times or rng.random() < _PARAMETER_REDRAWN:
                point[self._groups[j]] = self._level(rng, j, None)
        return point

    def _fill(self, rng: np.random.Generator, j: int, values: Array, start: int, pace: float) -> None:
        """Draw new pieces of an input from one of its cells on, in place."""
        at = start
        last = float(values[start - 1]) if start else None
        while at < len(values):
            length = max(1, round(pace * 2.0 ** rng.uniform(-1.0, 1.0)))
            last = self._level(rng, j, last)
            values[at : at + length] = last
            at += length

    def _level(self, rng: np.random.Generator, j: int, last: float | None) -> float:
        """Draw a value in [0, 1] of an input or parameter, another one than the last if it is discrete."""
        levels = self._levels[j]
        if levels is not None:
            others = levels if last is None or len(levels) < 2 else levels[np.abs(levels - last) > 1e-9]
            return float(rng.choice(others))
        if self._telling[j] and rng.random() < _TELLING:
            return float(rng.choice(self._telling[j]))
        cuts = self._cuts[j]
        if len(cuts) and rng.random() < _AIMED:
            if rng.random() < _EXACT:
                return float(rng.choice(cuts))
            edges = np.concatenate([[0.0], cuts, [1.0]])
            k = int(rng.integers(len(edges) - 1))
            return float(rng.uniform(edges[k], edges[k + 1]))
        return float(rng.integers(2)) if rng.random() < _AT_BOUND else float(rng.random())


def _cuts(ranged: InputRange | ParameterRange, values: Sequence[float]) -> NDArray[np.float64]:
    """Return levels as shares of a range, those at its bounds left out."""
    shares = {float(ranged.share_of(value)) for value in values if ranged.low < value < ranged.high}
    return np.array(sorted(share for share in shares if 0.0 < share < 1.0))


def _levels(ranged: InputRange | ParameterRange) -> NDArray[np.float64] | None:
    """Return the values in [0, 1] of a discrete input; None for a real one and for very many values."""
    width = ranged.high - ranged.low
    if ranged.kind == "real" or width > _MAX_LEVELS * 4 or len(ranged.numbers) > _MAX_LEVELS:
        return None
    return np.asarray(ranged.share_of(np.array(ranged.numbers)))
