"""Replies to a requirement in words: one to three formulas, each with the assumed units and two examples."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from falsifier.core.literals import one_line
from falsifier.core.trajectory import Trajectory
from falsifier.errors import SpecError
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.lenient import json_objects, repaired, without_thoughts
from falsifier.problem.template_advice import WHAT_CANNOT_BE_SAID

MOST_READINGS = 3
# Characters of a meaning that are kept.
_LONGEST_MEANING = 500


class _Reply(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, defer_build=True)


class AssumedUnit(_Reply):
    """The unit that a reading assumes for a signal."""

    signal: str
    unit: str


class ExampleSignal(_Reply):
    """One signal of an example, linear between its points."""

    name: str
    times: list[float] = Field(min_length=1, max_length=100)
    values: list[float] = Field(min_length=1, max_length=100)


class ReadingReply(_Reply):
    """One reading of the sentence."""

    formula: str
    meaning: str = Field(default="", description="In words, and how it differs from the other readings.")
    units: list[AssumedUnit] = Field(default_factory=list)
    satisfied: list[ExampleSignal] = Field(default_factory=list)
    violated: list[ExampleSignal] = Field(default_factory=list)


class ReadingsReply(_Reply):
    """All readings of the sentence, the most probable first."""

    readings: list[ReadingReply] = Field(max_length=MOST_READINGS)
    cannot: str = Field(default="", description="Why no formula says it; only if there are no readings.")


def readings_schema() -> dict[str, Any]:
    """Return the JSON Schema of a reply, within the subset of strict servers."""
    text, numbers = {"type": "string"}, {"type": "array", "items": {"type": "number"}}
    signals = _list(_object(name=text, times=numbers, values=numbers))
    reading = _object(
        formula=text,
        meaning=text,
        units=_list(_object(signal=text, unit=text)),
        satisfied=signals,
        violated=signals,
    )
    return _object(readings=_list(reading), cannot=text)


def read_readings(text: str) -> list[ReadingReply]:
    """Return the readings of a reply.

    Raises:
        RejectedReplyError: if it contains none, or they are not of the required form.
        SpecError: if it says that no formula can say it.
    """
    text = without_thoughts(text)
    found = [o for o in (*json_objects(text), repaired(text)) if isinstance(o, dict) and "readings" in o]
    if not found:
        raise RejectedReplyError('it contains no JSON object with "readings"')
    try:
        reply = ReadingsReply.model_validate(found[-1])
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise RejectedReplyError(f"{where}: {first['msg']}") from None
    if not reply.readings and reply.cannot.strip():
        said = one_line(reply.cannot.strip()[:_LONGEST_MEANING])
        raise SpecError(
            f"no formula was written, because the language model says: {said}\n{WHAT_CANNOT_BE_SAID}"
        )
    if not reply.readings:
        raise RejectedReplyError('it has neither "readings" nor a reason in "cannot"')
    return [r.model_copy(update={"meaning": r.meaning[:_LONGEST_MEANING]}) for r in reply.readings]


def example_trajectory(
    signals: Sequence[ExampleSignal], names: Sequence[str], times: np.ndarray[Any, np.dtype[np.float64]]
) -> Trajectory:
    """Return an example on a time grid.

    Raises:
        RejectedReplyError: if a signal is missing, or its points are not in order.
    """
    columns = {}
    for name in names:
        found = next((s for s in signals if s.name == name), None)
        if found is None:
            raise RejectedReplyError(f"an example lacks the signal {name!r}")
        if len(found.times) != len(found.values) or sorted(found.times) != found.times:
            raise RejectedReplyError(f"the example's signal {name!r} needs as many times as values, in order")
        columns[name] = np.interp(times, found.times, found.values)
    return Trajectory(times, columns)


def _object(**properties: Any) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def _list(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}
