"""Candidates as a language model writes them, in JSON of several forms.

What is read here is not compared with a search space yet; ``replies`` does that.
"""

import json
import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    FailFast,
    Field,
    ValidationError,
    ValidationInfo,
    WrapValidator,
)

from falsifier.core.literals import printable
from falsifier.core.signals import Interpolation
from falsifier.core.strict import Strict
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.json_text import objects_in, without_thoughts
from falsifier.problem.sections import no_truth

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_RUN = re.compile(rf"\s*({_NUMBER.pattern})\s*[x×*]\s*(\d+)\s*", re.ASCII)
# Numbers and runs are written with fewer characters; for longer texts the expressions above would take a time
# that grows with the square of the length.
LONGEST_NUMBER = 64
_LONGEST_RUN = 100_000
_LONGEST_RATIONALE = 2000
# More candidates than any question asks for; those beyond are not read.
_MOST_CANDIDATES = 1000
# Characters before the place where JSON breaks off that are told, and keys.
_SHOWN_BEFORE, _SHOWN_KEYS = 24, 10
# Keys of a candidate, and of what stands beside it and in its parts.
_PARTS = frozenset({"signals", "parameters", "point"})
_KEYS = _PARTS | {"candidates", "lessons", "rationale", "as_in"}
_KEYS |= {"name", "value", "values", "points", "times", "interpolation"}

# In a point: which of its places are Boolean is known once it is read.
_NumberOrTruth = Annotated[float, WrapValidator(lambda v, read: v if isinstance(v, bool) else read(v))]


def _unrolled(found: Any) -> Any:
    """Numbers, with runs such as ``"0 x 187"`` expanded; what is no list is left to be rejected."""
    if not isinstance(found, list):
        return found
    numbers: list[Any] = []
    for value in found:
        if not isinstance(value, str):
            numbers.append(value)
        elif len(value) <= LONGEST_NUMBER and (run := _RUN.fullmatch(value)):
            count = float(run[2])
            if len(numbers) + count > _LONGEST_RUN:
                raise RejectedReplyError(f"{value!r} makes the signal longer than {_LONGEST_RUN} values")
            numbers += [float(run[1])] * int(count)
        elif len(value) <= LONGEST_NUMBER and _NUMBER.fullmatch(number := value.strip()):
            numbers.append(float(number))
        else:
            raise RejectedReplyError(f"{quoted(value)} is neither a number nor a run such as '0 x 187'")
    return numbers


def _entries(found: Any, info: ValidationInfo) -> Any:
    """Convert what stands by name, and [time, value] pairs, which LLMs also write, to the listed form."""
    if isinstance(found, dict):
        key = "values" if info.field_name == "signals" else "value"
        found = [{"name": k, **(v if isinstance(v, dict) else {key: v})} for k, v in found.items()]
    return [_in_numbers(_pairs_apart(each), info) for each in found] if isinstance(found, list) else found


def _pairs_apart(part: Any) -> Any:
    if not isinstance(part, dict):
        return part
    part = _plain_keys(part)
    values = part.get("values", part.get("points"))
    if isinstance(values, int | float | str):
        return {**part, "values": [values]}
    if isinstance(values, list) and values and all(isinstance(v, list) and len(v) == 2 for v in values):
        rest = {k: v for k, v in part.items() if k != "points"}
        return {**rest, "times": [t for t, _ in values], "values": [v for _, v in values]}
    return part


def _in_numbers(part: Any, info: ValidationInfo) -> Any:
    """A signal or parameter with numbers in place of the words that stand for its values."""
    name = part.get("name") if isinstance(part, dict) else None
    known: Mapping[str, Mapping[str, float]] = info.context or {}
    if not isinstance(name, str) or name not in known:
        return part
    words = known[name]
    in_any_case = {word.lower(): number for word, number in words.items()}
    if len(in_any_case) < len(words):  # the case tells items apart
        in_any_case = {}

    def number(value: Any) -> Any:
        if not isinstance(value, str | bool):
            return value
        word = str(value).lower() if isinstance(value, bool) else value.strip()
        before, _, after = (part.strip() for part in word.rpartition("="))  # as the prompt has it, 2 = Lock
        found = words.get(word, in_any_case.get(word.lower(), in_any_case.get(after.lower())))
        if found is not None and before in ("", f"{found:g}"):
            return found
        if isinstance(value, str) and not (words and (before or word[:1].isalpha())):
            return value
        expected = f"none of {', '.join(map(quoted, words))}" if words else "no number"
        raise RejectedReplyError(f"{name}: {quoted(word)} is {expected}")

    given = {key: part[key] for key in ("value", "values") if key in part}
    found = {k: list(map(number, v)) if isinstance(v, list) else number(v) for k, v in given.items()}
    return {**part, **found} if found else part


def _storable(text: str) -> str:
    """The text up to a maximum length, as files can hold and terminals can show it."""
    return printable(text[: 2 * _LONGEST_RATIONALE])[:_LONGEST_RATIONALE]


class _Part(Strict):
    # A misspelt key within a part would change what is simulated.
    model_config = ConfigDict(allow_inf_nan=False)


class WrittenSignal(_Part):
    """One signal."""

    name: str
    values: Annotated[list[float], FailFast(), BeforeValidator(_unrolled)]
    times: Annotated[list[Annotated[float, BeforeValidator(no_truth)]] | None, FailFast()] = None
    interpolation: Interpolation | None = None


class WrittenParameter(_Part):
    """One parameter."""

    name: str
    value: float


class WrittenCandidate(BaseModel):
    """One candidate; unknown keys are ignored, not worth paying for another reply."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, defer_build=True)

    rationale: Annotated[str, BeforeValidator(lambda found: found or ""), AfterValidator(_storable)] = ""
    as_in: Annotated[int, BeforeValidator(lambda found: found or 0)] = 0
    signals: Annotated[list[WrittenSignal], FailFast(), BeforeValidator(_entries)] = Field(
        default_factory=list
    )
    parameters: Annotated[list[WrittenParameter], FailFast(), BeforeValidator(_entries)] = Field(
        default_factory=list
    )
    point: Annotated[list[_NumberOrTruth] | None, FailFast(), BeforeValidator(_unrolled)] = None


def candidates_in(text: str) -> list[dict[str, Any]]:
    """Return the candidates of a reply in order, valid or not; RejectedReplyError if there is none."""
    found = next((some for one in objects_in(text) if (some := _candidates_of(one))), [])
    if not found:
        other = _other_keys(without_thoughts(text))
        raise RejectedReplyError(f"it contains no JSON object with a candidate{other}")
    return found


def lessons_in(text: str) -> str:
    """What an LLM wrote down for its next question; empty if it did not."""
    objects = (_plain_keys(one) for one in objects_in(text) if isinstance(one, dict))
    lessons = next((one["lessons"] for one in objects if "lessons" in one), "")
    return printable(str(lessons or "")[:_LONGEST_RATIONALE])


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
    names = {key: low for key in found if (low := str(key).lower()) in _KEYS and low not in found}
    return {names.get(key, str(key)): value for key, value in found.items()}


def written_candidate(found: dict[str, Any], words: Mapping[str, Mapping[str, float]]) -> WrittenCandidate:
    """Read one candidate; RejectedReplyError stating what is wrong first.

    Words stand for numbers, by the name of an input or parameter.
    """
    try:
        return WrittenCandidate.model_validate(found, context=words)
    except ValidationError as error:
        raise RejectedReplyError(defect(error, found)) from None


def defect(error: ValidationError, found: Mapping[str, Any] = MappingProxyType({})) -> str:
    """What is wrong first, with the keys that are not known there: one of them may be what is missing."""
    errors = error.errors(include_url=False, include_context=False, include_input=False)
    first, place = errors[0], errors[0]["loc"][:-1]
    text = f"{'.'.join(str(part) for part in first['loc'])}{_whose(found, *first['loc'][:2])}: {first['msg']}"
    unknown = [
        quoted(str(e["loc"][-1])) for e in errors if e["type"] == "extra_forbidden" and e["loc"][:-1] == place
    ]
    if unknown and first["type"] == "missing":
        text += f"; unknown there: {', '.join(unknown[:_SHOWN_KEYS])}"
    return text


def _whose(found: Mapping[str, Any], part: int | str = "", index: int | str = "") -> str:
    """The name in an entry of the signals or parameters."""
    listed = found.get(str(part))
    if not isinstance(listed, dict | list) or not isinstance(index, int) or index >= len(listed):
        return ""
    entry = list(listed)[index]
    name = entry if isinstance(listed, dict) else entry.get("name") if isinstance(entry, dict) else None
    return f" (of {quoted(name)})" if isinstance(name, str) else ""


def _other_keys(text: str) -> str:
    """Why a reply without candidates has none: where its JSON breaks off, or which keys it has."""
    start = text.find("{")
    if start < 0:
        return ""
    try:
        found, _ = json.JSONDecoder(parse_int=float).raw_decode(text, start)
    except json.JSONDecodeError as error:
        before = quoted(text[max(start, error.pos - _SHOWN_BEFORE) : error.pos + 1])
        return f" that can be read: {error.msg} after {before}"
    except RecursionError:
        return ": it is nested too deeply"
    if "candidates" in _plain_keys(found):
        return ": expected 'candidates' to be a list of objects, and not an empty one"
    keys = ", ".join(quoted(key) for key in list(found)[:_SHOWN_KEYS])
    expected = ", ".join(repr(key) for key in sorted(_PARTS))
    return f": its keys are {keys}; expected {expected} or 'candidates'" if found else ""


def quoted(value: str) -> str:
    """A rejected value as a message quotes it."""
    return repr(value) if len(value) <= LONGEST_NUMBER else f"{value[:LONGEST_NUMBER]!r} ..."
