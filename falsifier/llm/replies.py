"""Replies of a language model: the required form, and the candidates of a search space that a reply has.

A prompt asks for signals by name, or for the numbers of a point in order. The other form is read, too.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from typing import Any

from falsifier.core.candidate import Candidate
from falsifier.core.literals import shortest
from falsifier.core.ranges import InputRange, Range, nearest_value
from falsifier.core.signals import INTERPOLATIONS, Signal
from falsifier.core.space import SearchSpace
from falsifier.core.words import counted, first_few
from falsifier.errors import CandidateError, SpecError, did_you_mean
from falsifier.llm.candidate_text import (
    LONGEST_NUMBER,
    WrittenCandidate,
    WrittenSignal,
    candidates_in,
    quoted,
    written_candidate,
)
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.json_text import schema_of_list, schema_of_object

# Defects of a candidate that are told.
_MOST_DEFECTS = 5
# Share of a range by which a value may exceed it: prompts show values with few digits.
_ROUNDING = 1e-3
_BOOLEAN = {"false": 0, "true": 1}
_TEXT = {"type": "string"}
_NUMBERS = schema_of_list({"type": "number"})


@dataclass(frozen=True, slots=True)
class ReplyForm:
    """What a reply must contain."""

    # What candidates must fit; without freedom if free parameterizations are not offered.
    space: SearchSpace
    # Signals and parameters by name; else one list of numbers in the order of the dimensions.
    named: bool = True
    count: int = 1  # number of candidates
    lessons: bool = False  # whether the LLM may write down what it is to be told again
    # Samples by number, from 1, to which a candidate may refer for what it leaves out; None: to none.
    samples: Sequence[Candidate] | None = None

    def schema(self) -> dict[str, Any]:
        """JSON Schema within the subset of strict servers: all keys required, no others allowed, no maps.

        No choice between schemas either: OpenAI refuses objects under ``anyOf`` whose first keys are the
        same. What an input cannot have is found when the reply is read. Numbers of items and ranges are
        stated as far as all inputs share them, and left out where a server does not take them.
        """
        candidate: dict[str, Any] = {"rationale": _TEXT}
        if self.samples is not None:
            candidate["as_in"] = {"type": "integer", "minimum": 0}
        if self.named:
            candidate |= self._named_parts()
        else:
            size = len(self.space.dimensions)
            candidate["point"] = schema_of_list({"type": "number"}, size, size)
        if self.count > 1:
            candidate = {"candidates": schema_of_list(schema_of_object(**candidate), 1, self.count)}
        before = {"lessons": _TEXT} if self.lessons else {}
        return schema_of_object(**before, **candidate)

    def _named_parts(self) -> dict[str, Any]:
        parts: dict[str, Any] = {}
        inputs, parameters = self.space.inputs, self.space.parameters
        least = None if self.samples is not None else 1
        if inputs:
            signal: dict[str, Any] = {"name": {"type": "string", "enum": [r.name for r in inputs]}}
            value = {"type": "number", **_range(inputs)}
            if any(r.free for r in inputs):
                possible = dict.fromkeys(i for r in inputs for i in _interpolations(r))
                signal["interpolation"] = {"type": "string", "enum": list(possible)}
                signal |= {"times": _NUMBERS, "values": schema_of_list(value)}
            else:
                counts = [r.control_points for r in inputs]
                signal["values"] = schema_of_list(value, min(counts), max(counts))
            parts["signals"] = schema_of_list(schema_of_object(**signal), least and len(inputs), len(inputs))
        if parameters:
            name = {"type": "string", "enum": [p.name for p in parameters]}
            parameter = schema_of_object(name=name, value={"type": "number", **_range(parameters)})
            parts["parameters"] = schema_of_list(parameter, least and len(parameters), len(parameters))
        return parts

    def read(self, text: str, *, origin: str = "") -> list[Candidate]:
        """Return a reply's valid candidates in order; RejectedReplyError saying what is wrong if none is."""
        written, valid, defects = candidates_in(text), list[Candidate](), list[str]()
        words = {r.name: _BOOLEAN if _is_truth(r) else dict(r.items) for r in self.space.ranges}
        for number, found in enumerate(written, start=1):
            try:
                valid.append(self._candidate(written_candidate(found, words), origin))
            except RejectedReplyError as rejection:
                defects.append(f"candidate {number}: {rejection}" if len(written) > 1 else str(rejection))
        if not valid:
            raise RejectedReplyError("; ".join(defects))
        return valid

    def _candidate(self, written: WrittenCandidate, origin: str) -> Candidate:
        if written.point is not None:
            return self._decoded(written.point, written.rationale, origin)
        if not self.named:  # what is wrong with a signal would tell names that were not told
            raise RejectedReplyError(f'expected a list of {len(self.space.dimensions)} numbers as "point"')
        signals, parameters, defects = dict[str, Signal](), dict[str, float](), list[str]()
        for signal in written.signals:
            with _collecting(defects):
                if signal.name in signals:
                    raise RejectedReplyError(f"input {quoted(signal.name)} is given twice")
                signals[signal.name] = self._signal(signal)
        ranges = {p.name: p for p in self.space.parameters}
        for p in written.parameters:
            with _collecting(defects):
                if p.name in parameters:
                    raise RejectedReplyError(f"parameter {quoted(p.name)} is given twice")
                parameters[p.name] = _possible(p.value, ranges[p.name]) if p.name in ranges else p.value
        signals, parameters = self._completed(written.as_in, signals, parameters)
        candidate = Candidate(signals, parameters, origin, written.rationale)
        if defects:
            defects += self.space.outside(candidate)
            raise RejectedReplyError(first_few(defects, _MOST_DEFECTS, between="; "))
        try:
            return self.space.admit(candidate)
        except CandidateError as error:
            raise RejectedReplyError(str(error)) from None

    def _completed(
        self, number: int, signals: dict[str, Signal], parameters: dict[str, float]
    ) -> tuple[dict[str, Signal], dict[str, float]]:
        """Return signals and parameters with those of a sample where they are left out; 0: of none."""
        is_complete = {*signals, *parameters}.issuperset(self.space.names)
        if not number or self.samples is None or is_complete:
            return signals, parameters
        if not 0 < number <= len(self.samples):
            raise RejectedReplyError(
                f'"as_in": there is no sample {number}; the latest is {len(self.samples)}'
            )
        sample = self.samples[number - 1]
        return {**sample.signals, **signals}, {**sample.parameters, **parameters}

    def _signal(self, written: WrittenSignal) -> Signal:
        ranges = {r.name: r for r in self.space.inputs}
        if written.name not in ranges:
            near = did_you_mean(written.name[:LONGEST_NUMBER], ranges)
            raise RejectedReplyError(f"unknown input {quoted(written.name)}; {near}")
        chosen = ranges[written.name]
        values = [_possible(v, chosen) for v in written.values]
        times = written.times or ()
        interpolation = written.interpolation or chosen.interpolation
        if not values:
            raise RejectedReplyError(f"input {quoted(written.name)} has no values")
        try:
            if len(values) == 1 and len(times) <= 1:
                constant = tuple(values * chosen.control_points)
                return Signal(self.space.fixed_times(chosen), constant, chosen.interpolation, chosen.hold)
            if times:
                return Signal(tuple(times), tuple(values), interpolation, chosen.hold)
            return Signal.evenly(
                values, stop_time=self.space.stop_time, interpolation=interpolation, hold=chosen.hold
            )
        except SpecError as error:
            raise RejectedReplyError(f"input {quoted(written.name)}: {error}") from None

    def _decoded(self, written: Sequence[float], rationale: str, origin: str) -> Candidate:
        dimensions, ranges = self.space.dimensions, {r.name: r for r in self.space.ranges}
        if len(written) != len(dimensions):
            raise RejectedReplyError(f"expected {counted(len(dimensions), 'number')}, got {len(written)}")
        for place, (value, d) in enumerate(zip(written, dimensions, strict=True), start=1):
            if isinstance(value, bool) and not _is_truth(ranges[d.name]):
                raise RejectedReplyError(f"number {place}: {quoted(str(value).lower())} is no number")
        numbers = [_clamped(v, ranges[d.name]) for v, d in zip(written, dimensions, strict=True)]
        outside = [
            f"number {place}: {value:.12g} is outside its range [{d.low:.12g}, {d.high:.12g}]"
            for place, (value, d) in enumerate(zip(numbers, dimensions, strict=True), start=1)
            if not d.low <= value <= d.high
        ]
        if outside and not self.named:
            raise RejectedReplyError(first_few(outside, _MOST_DEFECTS, between="; "))
        for place, (value, d) in enumerate(zip(numbers, dimensions, strict=True), start=1):
            _check_possible(value, ranges[d.name], f"number {place}")
        try:
            return self.space.decode(numbers, origin=origin, rationale=rationale)
        except CandidateError as error:
            what = str(error) if self.named else "the numbers are no sample: see what was said of each"
            raise RejectedReplyError(what) from None


@contextmanager
def _collecting(defects: list[str]) -> Iterator[None]:
    """Note a defect and go on: each reply costs, so that one says all that is wrong."""
    try:
        yield
    except RejectedReplyError as rejection:
        defects.append(str(rejection))


def _is_truth(ranged: Range) -> bool:
    """Whether it is a Boolean, or one that is told under a neutral name."""
    return ranged.kind == "boolean" or (ranged.kind == "integer" and (ranged.low, ranged.high) == (0.0, 1.0))


def _clamped(value: float, ranged: Range) -> float:
    """The value, or the limit that it exceeds by a rounding."""
    if ranged.at(-_ROUNDING) <= value <= ranged.at(1.0 + _ROUNDING):
        return min(max(value, ranged.low), ranged.high)
    return value


def _possible(value: float, ranged: Range) -> float:
    """The value, clamped; RejectedReplyError for one between those that can be taken."""
    value = _clamped(value, ranged)
    _check_possible(value, ranged, ranged.label)
    return value


def _check_possible(value: float, ranged: Range, label: str) -> None:
    nearest = nearest_value(ranged, value) if isfinite(value) else value
    if value != nearest and (ranged.items or value != round(value)):
        what = "none of its numbers" if ranged.items else "no whole number"
        raise RejectedReplyError(f"{label}: {shortest(value)} is {what}; the nearest is {shortest(nearest)}")


def _range(ranges: Sequence[Range]) -> dict[str, float]:
    """The range that holds for all of them, and a rounding more, as it is accepted."""
    low, high = min(r.at(-_ROUNDING) for r in ranges), max(r.at(1.0 + _ROUNDING) for r in ranges)
    return {"minimum": low, "maximum": high}


def _interpolations(r: InputRange) -> tuple[str, ...]:
    """Interpolations that an input can have if others are free."""
    if r.free is None:
        return (r.interpolation,)
    return INTERPOLATIONS if r.kind == "real" else ("constant",)
