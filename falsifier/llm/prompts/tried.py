"""Which values of what is chosen the samples have tried; told where the robustness gives no direction."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TypeVar

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import InputRange, Range
from falsifier.core.signals import Signal
from falsifier.core.words import listed, readable
from falsifier.llm.prompts.numbers import bounds
from falsifier.llm.prompts.view import View

# Share of a range that is told if no sample had a value in it.
_WIDE = 0.3
# Values of an interpolated input that count as tried, values that are listed, digits of the others.
_VALUES, _MOST_LISTED, _DIGITS = 100, 6, 2
# More different ranges, or stays, most of which do not matter, are not told.
_MOST_GAPS = 4
# The longest stay at a value is told if it is shorter than this share of the simulation, or this one if there
# are few values; of parts of the range of a real input, of which there are so many, if it is that brief.
_LONG, _LONG_OF_FEW, _FEW, _BRIEF, _PARTS = 0.3, 0.7, 3, 0.02, 10
_SOME_PARTS = range(1, 6)  # more of them are not told

T = TypeVar("T", bound=Range)


@dataclass(slots=True)
class Tried:
    """The values that samples had so far, by the name of the input or parameter."""

    view: View
    _values: dict[str, set[float]] = field(default_factory=dict)
    _longest: dict[str, dict[float, float]] = field(default_factory=dict)  # stay in s of an input at a value

    def add(self, candidate: Candidate) -> None:
        """Add a sample."""
        for name, signal in candidate.signals.items():
            values = signal.values
            if signal.interpolation != "constant":  # it passes through all between the least and the greatest
                values = np.linspace(min(values), max(values), _VALUES).tolist()
            self._values.setdefault(name, set()).update(values)
            longest = self._longest.setdefault(name, {})
            for value, stay in _stays(signal, self.view.space.stop_time):
                longest[value] = max(stay, longest.get(value, 0.0))
        for name, value in candidate.parameters.items():
            self._values.setdefault(name, set()).add(value)

    @property
    def gaps(self) -> str:
        """What no sample tried; empty if they tried about all, or left out too many different things."""
        space = self.view.space
        return "; ".join((*_alike(space.ranges, self._gap), *_alike(space.inputs, self._short)))

    def _gap(self, r: Range) -> str:
        tried = sorted(self._values.get(r.name, ()))
        if r.kind != "real" and r.high - r.low < _VALUES:
            left = [str(n) for n in r.numbers if n not in tried]
            few = ", ".join((*left[:_MOST_LISTED], *(["..."] if len(left) > _MOST_LISTED else [])))
            return f"= {few}" if left else ""
        edges = [r.low, *tried, r.high]
        gaps = np.diff(r.share_of(np.array(edges)))
        told = []
        for k in np.flatnonzero(gaps > _WIDE).tolist():
            low, high = bounds(edges[k], edges[k + 1], _DIGITS)
            if edges[k] not in tried:
                told.append(f"from {low} to below {high}")
            elif edges[k + 1] not in tried:
                told.append(f"above {low} up to {high}")
            else:
                told.append(f"between {low} and {high}")
        return ", ".join(told)

    def _short(self, r: InputRange) -> str:
        """Values at which an input that may stay at one never stayed for long."""
        if not (r.free or (r.interpolation == "constant" and r.control_points > 1)):
            return ""
        stays = self._longest.get(r.name, {})
        if r.kind == "real":
            return self._short_between(r, {v: stay for v, stay in stays.items() if r.low < v < r.high})
        stop_time, is_few = self.view.space.stop_time, len(r.numbers) <= _FEW
        at = {stay: [str(int(v)) for v, s in sorted(stays.items()) if s == stay] for stay in stays.values()}
        whole = f" of {readable(stop_time, _DIGITS + 1)} s" if is_few else ""
        told = (
            f"at {', '.join(values[:_MOST_LISTED])} for more than {_rounded_up(stay)} s{whole}"
            for stay, values in sorted(at.items())
            if 0 < stay < (_LONG_OF_FEW if is_few else _LONG) * stop_time
        )
        return ", ".join(told)

    def _short_between(self, r: InputRange, stays: Mapping[float, float]) -> str:
        """The same of values between the limits: of all of them, or of the parts with hardly any stay."""
        longest, stop_time = max(stays.values(), default=0.0), self.view.space.stop_time
        if not longest:
            return ""
        if longest < _LONG * stop_time:
            return f"at a value between its limits for more than {_rounded_up(longest)} s"
        in_part = np.zeros(_PARTS)
        for value, stay in stays.items():
            part = min(int(r.share_of(value) * _PARTS), _PARTS - 1)
            in_part[part] = max(in_part[part], stay)
        short, told = np.flatnonzero(in_part < _BRIEF * stop_time), list[str]()
        runs = np.split(short, np.flatnonzero(np.diff(short) > 1) + 1) if len(short) in _SOME_PARTS else []
        for run in runs:
            begin, end = bounds(r.at(int(run[0]) / _PARTS), r.at((int(run[-1]) + 1) / _PARTS), _DIGITS)
            most = float(in_part[run].max())
            beyond = f" for more than {_rounded_up(most)} s" if most else ""
            told.append(f"{'' if most else 'constant '}between {begin} and {end}{beyond}")
        return ", ".join(told)


def _rounded_up(stay: float) -> str:
    """A time in s that no stay exceeds, in few digits."""
    text = readable(stay, _DIGITS + 1)
    return text if float(text) >= stay else readable(stay * 1.005, _DIGITS + 1)


def _alike(ranges: Sequence[T], of: Callable[[T], str]) -> list[str]:
    """What is so of ranges, those of which the same is so together; nothing if too much is."""
    alike: dict[str, list[str]] = {}
    for r in ranges:
        if text := of(r):
            alike.setdefault(text, []).append(r.name)
    return [f"{listed(names)} {text}" for text, names in alike.items()] if len(alike) <= _MOST_GAPS else []


def _stays(signal: Signal, stop_time: float) -> Iterator[tuple[float, float]]:
    """The values at which a signal stays, and for how long in s each time."""
    signal = signal.stepped(stop_time)
    starts = [0, *(k for k in range(1, len(signal.values)) if signal.values[k] != signal.values[k - 1])]
    for start, stop in pairwise((*starts, len(signal.values))):
        end = stop if signal.interpolation == "constant" else stop - 1
        until = signal.times[end] if stop < len(signal.values) else stop_time
        yield signal.values[start], until - signal.times[start]
