"""Replies of a language model: the required form, and how candidates are read from a reply.

A prompt asks for one of two forms: JSON with signals by name and a rationale, or the numbers of a point in
order between ``<point>`` and ``</point>``. A reply in the other form is read too.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    FailFast,
    Field,
    ValidationError,
)

from falsifier.core.candidate import Candidate
from falsifier.core.literals import printable
from falsifier.core.signals import INTERPOLATIONS, Interpolation, Signal
from falsifier.core.space import Dimension, InputRange, ParameterRange, SearchSpace
from falsifier.core.words import counted
from falsifier.errors import CandidateError, did_you_mean
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.json_text import json_objects, repaired, without_thoughts

_POINT_TAG = re.compile(r"<(/?)point>", re.IGNORECASE)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_RUN = re.compile(rf"\s*({_NUMBER.pattern})\s*[x×*]\s*(\d+)\s*", re.ASCII)
# Numbers and runs are written with fewer characters; for longer texts the expressions above would take a time
# that grows with the square of the length.
_LONGEST_NUMBER = 64
_LONGEST_RUN = 100_000
_LONGEST_RATIONALE = 2000
# More candidates than any question asks for; those beyond are not read.
_MOST_CANDIDATES = 1000
# Characters before the place where JSON breaks off that are told.
_SHOWN_BEFORE = 24
# Numbers outside of their ranges that are told.
_MOST_OUTSIDE = 5
# Share of a range by which a value may exceed it.
_ROUNDING = 1e-3
# Keys of a candidate, of its parts, and of several candidates.
_PARTS = frozenset({"signals", "parameters", "point"})
_KEYS = _PARTS | {"candidates", "rationale", "lessons", "keep"}
_KEYS |= {"name", "values", "value", "times", "points", "interpolation"}


@dataclass(frozen=True, slots=True)
class Answer:
    """What a reply says.

    Attributes:
        candidates: the valid ones, in order.
        lessons: what the LLM wrote down for its next question.
        kept: numbers, from 1, of its earlier candidates on which it insists.
    """

    candidates: tuple[Candidate, ...]
    lessons: str = ""
    kept: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class ReplyForm:
    """What a reply must contain.

    Attributes:
        space: search space that candidates must fit.
        named: signals and parameters by name; else one list of numbers in the order of the dimensions.
        free: whether a free parameterization may be used if the space allows it.
        points: numbers between tags are asked for, not JSON; tools take the same numbers as JSON.
        count: number of candidates.
        reasoned: whether each candidate comes with a rationale.
        lessons: whether the LLM may write down what it is to be told again.
        keepable: number of earlier candidates on which it may insist.
    """

    space: SearchSpace
    named: bool = True
    free: bool = False
    points: bool = False
    count: int = 1
    reasoned: bool = True
    lessons: bool = False
    keepable: int = 0

    @property
    def is_free(self) -> bool:
        """Whether the LLM may choose the control points of any input."""
        return self.free and any(r.free for r in self.space.inputs)

    def schema(self) -> dict[str, Any]:
        """JSON Schema within the subset of strict servers: all keys required, no others allowed, no maps.

        No choice between schemas either: OpenAI refuses objects under ``anyOf`` whose first keys are the
        same. What an input cannot have is found when the reply is read. Numbers of items and ranges are
        stated as far as all inputs share them, and left out where a server does not take them.
        """
        parts: dict[str, Any] = {"rationale": _TEXT} if self.reasoned else {}
        candidate = parts | (self._named_parts() if self.named else {"point": self._point_part()})
        whole = candidate
        if self.count > 1:
            whole = {"candidates": _list(_object(**candidate), 0 if self.keepable else 1, self.count)}
        before = {"lessons": _TEXT} if self.lessons else {}
        after = {"keep": _list({"type": "integer"}, 0, self.keepable)} if self.keepable else {}
        return _object(**before, **whole, **after)

    def _point_part(self) -> dict[str, Any]:
        return _list({"type": "number"}, len(self.space.dimensions), len(self.space.dimensions))

    def _named_parts(self) -> dict[str, Any]:
        parts: dict[str, Any] = {}
        if self.space.inputs:
            possible = (i for r in self.space.inputs for i in _interpolations(r)) if self.is_free else ()
            count = len(self.space.inputs)
            parts["signals"] = _list(self._signal_part(tuple(dict.fromkeys(possible))), count, count)
        if self.space.parameters:
            name = {"type": "string", "enum": [p.name for p in self.space.parameters]}
            count = len(self.space.parameters)
            value = {"type": "number", **_range(self.space.parameters)}
            parts["parameters"] = _list(_object(name=name, value=value), count, count)
        return parts

    def _signal_part(self, interpolations: tuple[str, ...]) -> dict[str, Any]:
        """Schema of a signal with one of the names; without interpolations, its control points are fixed."""
        inputs = self.space.inputs
        name = {"type": "string", "enum": [r.name for r in inputs]}
        number = {"type": "number", **_range(inputs)}
        if interpolations:
            values = {"type": "array", "items": number}
            interpolation = {"type": "string", "enum": list(interpolations)}
            return _object(name=name, interpolation=interpolation, times=_NUMBERS, values=values)
        counts = [r.control_points for r in inputs]
        return _object(name=name, values=_list(number, min(counts), max(counts)))

    def read(self, text: str, *, origin: str = "") -> Answer:
        """Read the valid candidates of a reply, and what it says beside them.

        Raises:
            RejectedReplyError: if none is valid and none is kept; states what is wrong with each.
        """
        beside = _beside(text) if self.keepable else {}
        kept = tuple(n for n in _whole_numbers(beside.get("keep")) if 1 <= n <= self.keepable)
        try:
            found = self.read_each(text, origin=origin)
        except RejectedReplyError:
            if not kept:
                raise
            found = []
        candidates = [one for one in found if isinstance(one, Candidate)]
        if not candidates and not kept:
            numbered = len(found) > 1
            raise RejectedReplyError(
                "; ".join(f"candidate {i}: {one}" if numbered else str(one) for i, one in enumerate(found, 1))
            )
        return Answer(tuple(candidates), lessons_in(text) if self.lessons else "", kept)

    def read_each(self, text: str, *, origin: str = "") -> list[Candidate | RejectedReplyError]:
        """Read the candidates of a reply in order; an invalid one is replaced by an error with its defect.

        Raises:
            RejectedReplyError: if the reply contains no candidate, valid or not.
        """
        text = without_thoughts(text)
        # Reasoning may contain drafts before what is meant, and speak of the tags.
        points = _points(text)[-self.count :] if self.points else _points(text)
        found: Sequence[str | dict[str, Any]] = (
            points or _candidate_objects(text) if self.points else _candidate_objects(text) or points
        )
        if not found:
            missing = (
                "numbers between <point> and </point>" if self.points else "JSON object with a candidate"
            )
            raise RejectedReplyError(f"it contains no {missing}{'' if self.points else _other_keys(text)}")
        each: list[Candidate | RejectedReplyError] = []
        for one in found:
            try:
                reply = CandidateReply(point=self._numbers(one)) if isinstance(one, str) else _validated(one)
                each.append(self._candidate(reply, origin))
            except RejectedReplyError as rejection:
                each.append(rejection)
        return each

    def _numbers(self, text: str) -> list[float | str]:
        """Numbers of a point; the tags are spoken of only if they were asked for."""
        where = " between <point> and </point>" if self.points else ""
        words = [w for w in re.split(r"[\s,;()\[\]]+", text) if w]
        for word in words:
            if len(word) > _LONGEST_NUMBER or not _NUMBER.fullmatch(word):
                raise RejectedReplyError(f"expected only numbers{where}, got {_shown(word)}")
        if not all(isfinite(float(word)) for word in words):
            raise RejectedReplyError(f"expected only finite numbers{where}")
        return [float(word) for word in words]

    def _candidate(self, reply: "CandidateReply", origin: str) -> Candidate:
        if reply.point is not None:
            return self._decoded(_unrolled(reply.point), reply.rationale, origin)
        if not self.named:  # what is wrong with a signal would tell names that were not told
            raise RejectedReplyError(f'expected a list of {len(self.space.dimensions)} numbers as "point"')
        signals = {}
        for signal in reply.signals:
            if signal.name in signals:
                raise RejectedReplyError(f"input {_shown(signal.name)} is given twice")
            signals[signal.name] = self._signal(signal)
        ranges = {p.name: p for p in self.space.parameters}
        parameters: dict[str, float] = {}
        for p in reply.parameters:
            if p.name in parameters:
                raise RejectedReplyError(f"parameter {_shown(p.name)} is given twice")
            parameters[p.name] = _clamped(p.value, ranges[p.name]) if p.name in ranges else p.value
        return self._admitted(Candidate(signals, parameters, origin, reply.rationale))

    def _allowed(self) -> SearchSpace:
        """Search space with free parameterization only if the LLM was offered it."""
        if self.free:
            return self.space
        return replace(self.space, inputs=tuple(replace(r, free=None) for r in self.space.inputs))

    def _signal(self, reply: "SignalReply") -> Signal:
        ranges = {r.name: r for r in self.space.inputs}
        if reply.name not in ranges:
            near = did_you_mean(reply.name[:_LONGEST_NUMBER], ranges)
            raise RejectedReplyError(f"unknown input {_shown(reply.name)}; {near}")
        chosen = ranges[reply.name]
        values = [_clamped(v, chosen) for v in _unrolled(reply.values)]
        times = reply.times or ()
        interpolation = reply.interpolation or chosen.interpolation
        if not values:
            raise RejectedReplyError(f"input {_shown(reply.name)} has no values")
        try:
            if len(values) == 1 and len(times) <= 1:
                constant = tuple(values * chosen.control_points)
                return Signal(self.space.fixed_times(chosen), constant, chosen.interpolation, chosen.hold)
            if times:
                return Signal(tuple(times), tuple(values), interpolation, chosen.hold)
            return Signal.evenly(
                values, stop_time=self.space.stop_time, interpolation=interpolation, hold=chosen.hold
            )
        except ValueError as error:
            raise RejectedReplyError(f"input {_shown(reply.name)}: {error}") from None

    def _decoded(self, numbers: list[float], rationale: str, origin: str) -> Candidate:
        dimensions = self.space.dimensions
        if len(numbers) != len(dimensions):
            raise RejectedReplyError(f"expected {counted(len(dimensions), 'number')}, got {len(numbers)}")
        numbers = [_clamped(v, d) for v, d in zip(numbers, dimensions, strict=True)]
        outside = [
            f"number {place}: {value:g} is outside its range [{d.low:g}, {d.high:g}]"
            for place, (value, d) in enumerate(zip(numbers, dimensions, strict=True), start=1)
            if not d.low <= value <= d.high
        ]
        if outside and not self.named:
            more = f"; and {len(outside) - _MOST_OUTSIDE} more" if len(outside) > _MOST_OUTSIDE else ""
            raise RejectedReplyError("; ".join(outside[:_MOST_OUTSIDE]) + more)
        try:
            return self.space.decode(numbers, origin=origin, rationale=rationale)
        except CandidateError as error:
            what = str(error) if self.named else "the numbers are no sample: see what was said of each"
            raise RejectedReplyError(what) from None

    def _admitted(self, candidate: Candidate) -> Candidate:
        try:
            return self._allowed().admit(candidate)
        except CandidateError as error:
            raise RejectedReplyError(str(error)) from None


def _clamped(value: float, ranged: InputRange | ParameterRange | Dimension) -> float:
    """The value, or the limit that it exceeds by a rounding: prompts show values with few digits."""
    slack = _ROUNDING * (ranged.high - ranged.low)
    if ranged.low - slack <= value <= ranged.high + slack:
        return min(max(value, ranged.low), ranged.high)
    return value


_TEXT = {"type": "string"}
_NUMBERS = {"type": "array", "items": {"type": "number"}}


def _object(**properties: Any) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def _list(items: dict[str, Any], least: int, most: int) -> dict[str, Any]:
    return {"type": "array", "items": items, "minItems": least, "maxItems": most}


def _range(ranges: Sequence[InputRange | ParameterRange]) -> dict[str, float]:
    """The range that holds for all of them, and a rounding more."""
    low, high = min(r.low for r in ranges), max(r.high for r in ranges)
    slack = _ROUNDING * (high - low)
    return {"minimum": low - slack, "maximum": high + slack}


def _interpolations(r: InputRange) -> tuple[str, ...]:
    """Interpolations that an input can have if others are free."""
    if r.free is None:
        return (r.interpolation,)
    return INTERPOLATIONS if r.kind == "real" else ("constant",)


class _Reply(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


class SignalReply(_Reply):
    """One signal, as an LLM writes it."""

    name: str
    values: Annotated[list[float | str], FailFast()]
    times: Annotated[list[float] | None, FailFast()] = None
    interpolation: Interpolation | None = None


class ParameterReply(_Reply):
    """One parameter, as an LLM writes it."""

    name: str
    value: float


def _signals_by_name(found: Any) -> Any:
    """Convert ``{name: values}`` and [time, value] pairs, which LLMs also write, to the listed form."""
    if isinstance(found, dict):
        found = [{"name": k, **(v if isinstance(v, dict) else {"values": v})} for k, v in found.items()]
    return [_pairs_apart(s) for s in found] if isinstance(found, list) else found


def _pairs_apart(signal: Any) -> Any:
    if not isinstance(signal, dict):
        return signal
    signal = _plain_keys(signal)
    values = signal.get("values", signal.get("points"))
    if not isinstance(values, list):
        return {**signal, "values": [values]} if isinstance(values, int | float) else signal
    if values and all(isinstance(pair, list) and len(pair) == 2 for pair in values):
        rest = {k: v for k, v in signal.items() if k not in ("points", "times", "values")}
        return {**rest, "times": [t for t, _ in values], "values": [v for _, v in values]}
    return signal


def _parameters_by_name(found: Any) -> Any:
    if isinstance(found, dict):
        return [{"name": k, "value": v} for k, v in found.items()]
    return [_plain_keys(p) if isinstance(p, dict) else p for p in found] if isinstance(found, list) else found


def _storable(text: str) -> str:
    """The text up to a maximum length, as files can hold and terminals can show it."""
    return printable(text[: 2 * _LONGEST_RATIONALE])[:_LONGEST_RATIONALE]


def _text_or_none(found: Any) -> Any:
    return "" if found is None else found


class CandidateReply(BaseModel):
    """One candidate, as an LLM writes it; unknown keys are ignored, not worth paying for another reply."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, defer_build=True)

    rationale: Annotated[str, BeforeValidator(_text_or_none), AfterValidator(_storable)] = ""
    signals: Annotated[list[SignalReply], FailFast(), BeforeValidator(_signals_by_name)] = Field(
        default_factory=list
    )
    parameters: Annotated[list[ParameterReply], FailFast(), BeforeValidator(_parameters_by_name)] = Field(
        default_factory=list
    )
    point: Annotated[list[float | str] | None, FailFast()] = None


def _validated(found: dict[str, Any]) -> CandidateReply:
    try:
        return CandidateReply.model_validate(found)
    except ValidationError as error:
        raise RejectedReplyError(_defect(error)) from None


def _defect(error: ValidationError) -> str:
    """What is wrong first, with the keys that are not known there: one of them may be what is missing."""
    errors = error.errors(include_url=False, include_context=False, include_input=False)
    first = errors[0]
    where = ".".join(str(part) for part in first["loc"])
    place = first["loc"][:-1]
    unknown = [
        _shown(str(e["loc"][-1])) for e in errors if e["type"] == "extra_forbidden" and e["loc"][:-1] == place
    ]
    text = f"{where}: {first['msg']}"
    if unknown and first["type"] == "missing":
        text += f"; unknown there: {', '.join(unknown[:10])}"
    return text


def _candidate_objects(text: str) -> list[dict[str, Any]]:
    """Candidates of the last JSON object that contains any: reasoning may show drafts before it."""
    for found in reversed(list(json_objects(text))):
        if candidates := _candidates_of(found):
            return candidates
    return _candidates_of(repaired(text))


def lessons_in(text: str) -> str:
    """What an LLM wrote down for its next question; empty if it did not."""
    return printable(str(_beside(text).get("lessons") or "")[:_LONGEST_RATIONALE])


def _beside(text: str) -> dict[str, Any]:
    """What the last JSON object of a reply says beside its candidates."""
    text = without_thoughts(text)
    objects = [found for found in (*json_objects(text), repaired(text)) if isinstance(found, dict)]
    found = [_plain_keys(one) for one in objects]
    return next((one for one in reversed(found) if {"lessons", "keep"} & one.keys()), {})


def _whole_numbers(found: Any) -> list[int]:
    numbers = found if isinstance(found, list) else []
    return [int(n) for n in numbers if isinstance(n, int | float) and isfinite(n) and n == int(n)]


def _other_keys(text: str) -> str:
    """Why a reply without candidates has none: where its JSON breaks off, or which keys it has."""
    start = text.find("{")
    if start < 0:
        return ""
    try:
        found, _ = json.JSONDecoder(parse_int=float).raw_decode(text, start)
    except json.JSONDecodeError as error:
        before = _shown(text[max(start, error.pos - _SHOWN_BEFORE) : error.pos + 1])
        return f" that can be read: {error.msg} after {before}"
    except RecursionError:
        return ": it is nested too deeply"
    keys = ", ".join(_shown(key) for key in list(found)[:10])
    expected = ", ".join(repr(key) for key in sorted(_PARTS))
    return f": its keys are {keys}; expected {expected} or 'candidates'" if found else ""


def _candidates_of(found: Any) -> list[dict[str, Any]]:
    """Candidates that an object is or contains, or that a list without a key consists of."""
    if isinstance(found, dict):
        found = _plain_keys(found)
        several = found.get("candidates")
        if isinstance(several, list) and several and all(isinstance(c, dict) for c in several):
            return [_plain_keys(one) for one in several[:_MOST_CANDIDATES]]
        return [found] if _PARTS & found.keys() else []
    if not isinstance(found, list) or not found:
        return []
    if all(isinstance(one, int | float) for one in found):
        return [{"point": found}]
    objects = [_plain_keys(one) for one in found if isinstance(one, dict)]
    if len(objects) < len(found):
        return []
    if all(_PARTS & one.keys() for one in objects):
        return objects[:_MOST_CANDIDATES]
    return [{"signals": objects}] if all({"name", "values"} <= one.keys() for one in objects) else []


def _plain_keys(found: dict[str, Any]) -> dict[str, Any]:
    """An object with known keys in the case in which they were asked for."""
    lowered = ((key.lower() if isinstance(key, str) else str(key), key) for key in found)
    names = {key: low if low in _KEYS and low not in found else str(key) for low, key in lowered}
    return {names[key]: value for key, value in found.items()}


def _points(text: str) -> list[str]:
    """What stands between the tags, or after the only one."""
    found: list[str]
    found, begun = [], -1
    for tag in _POINT_TAG.finditer(text):
        if not tag[1]:
            begun = tag.end()
        elif begun >= 0:
            found.append(text[begun : tag.start()])
            begun = -1
    if begun >= 0 and not found:  # a model that stops at the end of the numbers
        found.append(text[begun:])
    return found[-_MOST_CANDIDATES:]


def _unrolled(values: list[float | str]) -> list[float]:
    """Numbers, with runs such as ``"0 x 187"`` expanded."""
    numbers: list[float] = []
    for value in values:
        if not isinstance(value, str):
            numbers.append(float(value))
        elif len(value) > _LONGEST_NUMBER:
            raise RejectedReplyError(f"{_shown(value)} is neither a number nor a run such as '0 x 187'")
        elif run := _RUN.fullmatch(value):
            count = float(run[2])
            if len(numbers) + count > _LONGEST_RUN:
                raise RejectedReplyError(f"{value!r} makes the signal longer than {_LONGEST_RUN} values")
            numbers.extend([float(run[1])] * int(count))
        elif _NUMBER.fullmatch(number := value.strip()):
            numbers.append(float(number))
        else:
            raise RejectedReplyError(f"{value!r} is neither a number nor a run such as '0 x 187'")
    return numbers


def _shown(value: str) -> str:
    """A rejected value as a message quotes it."""
    return repr(value) if len(value) <= _LONGEST_NUMBER else f"{value[:_LONGEST_NUMBER]!r} ..."
