"""Requirements in words: the question of what one means, and the replies.

A question tells the signals and the language of formulas. A reply has one to three formulas, each with the
assumed units and two examples.
"""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from falsifier.core.experiment import Experiment
from falsifier.core.literals import one_line
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.trajectory import Trajectory
from falsifier.errors import SpecError
from falsifier.llm.candidate_text import defect
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.json_text import objects_in, schema_of_list, schema_of_object
from falsifier.llm.messages import Message
from falsifier.llm.prompts.numbers import number
from falsifier.problem.templates import TEMPLATES

MOST_READINGS = 3
# Characters of a meaning that are kept.
_LONGEST_MEANING = 500
# Maximum number of variables that are listed; inputs and outputs come first.
_MOST_VARIABLES = 120

_LANGUAGE = """Formulas are Signal Temporal Logic over the signals below, judged at recorded times from 0 on.
- Comparisons: < <= > >= ; 1 <= x <= 3 is allowed. A Boolean signal b may stand alone.
- not, and, or, -> (implies), <-> ; put the scope of temporal operators in parentheses.
- G[a,b] (f): f holds throughout from a to b seconds later. F[a,b] (f): f holds at some time then.
- f U[a,b] g: g holds at some time from a to b seconds later, and f until then.
- X (f): f holds at the next recorded time.
- Arithmetic: + - * / ^ abs sqrt exp log sin cos min max. There are no derivatives and no earlier values.
- "Becomes true" is: (not (c) and X (c)) -> X (...).
- Windows are closed, in seconds, look forward, and nested ones add up. The sum must not exceed the stop time.
- Use == and != on whole numbers, Booleans and enumerations only; for a whole number abs(x - 3) <= 0.5 says
  the same as x == 3, with a margin that leads a search.
- Names are written exactly as listed; names with unusual characters stand in double quotes."""

_ANSWER = """Answer with one JSON object: {"readings": [...], "cannot": ""}. Give one reading if the sentence
is clear, and two or three, the most probable first, if engineers could understand it differently. Each
reading has
- formula: the formula.
- meaning: one sentence that says what it requires, and how it differs from the other readings.
- units: a list of {"signal": name, "unit": the unit in which you wrote its numbers, "" if it has none}.
- satisfied: a small example that meets the sentence as you understand it: a list of {"name": signal,
  "times": [s], "values": [...]}, linear between them, for each signal of the formula.
- violated: the same for an example that does not meet it.
The formula is checked on both examples, so choose values clearly on one side of every threshold.
If no formula over these signals can say it (a rate without a signal that is the rate, "after each step" of
any size, an average, earlier values), do not write one that says something else: leave readings empty, and
say in "cannot" why, and which signal or level would be needed. Otherwise "cannot" is ""."""

_WHAT_CANNOT_BE_SAID = (
    "Formulas compare values of the same sample. A rate needs a signal that is the rate, or the template "
    'ramp_limit with over and range; "after each step" needs a level that the step crosses, such as '
    'after = "target > 50"; averages and earlier values need a signal of the model.'
)


def formalizing_messages(sentence: str, info: ModelInfo, experiment: Experiment) -> tuple[Message, ...]:
    """Return the messages that ask for formulas of a requirement in words."""
    system = (
        "You translate requirements on simulated systems from plain words, in any language, into formulas. "
        "Be exact about what the sentence says and do not add conditions that it does not contain."
    )
    usual = (f"- {name}: {template.summary}; {_PATTERNS[name]}" for name, template in TEMPLATES.items())
    parts = [
        _LANGUAGE,
        "\n".join(["Usual kinds of requirements:", *usual]),
        "\n".join(_model(info, experiment)),
        f"The requirement:\n{sentence.strip()}",
        _ANSWER,
    ]
    return Message(role="system", content=system), Message(role="user", content="\n\n".join(parts))


_PATTERNS = {
    "settles": "G[t,T] (abs(x - r) <= 0.02*abs(r))",
    "overshoot": "G[0,T] (x - r <= 0.1*abs(r))",
    "rise": "F[0,t] (x >= 0.9*r)",
    "response": "G[0,T-t] (when -> F[0,t] then)",
    "stays_within": "G[0,T] (low <= x and x <= high)",
    "never_together": "G[0,T] not (a and b)",
    "dwell": "G[0,T-t-h] ((not c and X c) -> X G[0,t] c), h one sampling step",
    "ramp_limit": "G[0,T] (abs(rate) <= limit), if a signal is the rate",
    "order": "not (not first U[0,T] later)",
}


def _model(info: ModelInfo, experiment: Experiment) -> Iterator[str]:
    described = f": {info.description}" if info.description else ""
    yield f"The model {info.name}{described}"
    yield (
        f"It is simulated from 0 to T = {number(experiment.stop_time)} s and sampled every "
        f"{number(experiment.output_interval)} s; bounds of windows are multiples of that."
    )
    yield "Signals:"
    variables = (*info.inputs, *info.outputs, *info.with_causality("local"))
    told = [_variable(v) for v in variables if v.kind != "string"]
    yield from told[:_MOST_VARIABLES]
    if hidden := len(told[_MOST_VARIABLES:]):
        yield f"and {hidden} more variables"


def _variable(v: Variable) -> str:
    low, high = v.limits
    facts = [v.causality if v.causality in ("input", "output") else "internal", v.kind]
    facts += [f"in {v.unit}"] if v.unit else []
    facts += [f"at least {number(low)}"] if low is not None else []
    facts += [f"at most {number(high)}"] if high is not None else []
    facts += [v.items_text] if v.items_text else []
    return f"- {v.name} ({', '.join(facts)})" + (f": {v.description}" if v.description else "")


# That nothing is to be said, LLMs write as null, too.
_Text = Annotated[str, BeforeValidator(lambda found: "" if found is None else found)]


class _Reply(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, defer_build=True)


class AssumedUnit(_Reply):
    """The unit that a reading assumes for a signal."""

    signal: str
    unit: _Text


class ExampleSignal(_Reply):
    """One signal of an example, linear between its points."""

    name: str
    times: list[float] = Field(min_length=1, max_length=100)
    values: list[float] = Field(min_length=1, max_length=100)


class ReadingReply(_Reply):
    """One reading of the sentence."""

    formula: str
    meaning: _Text = Field(default="", description="In words, and how it differs from the other readings.")
    units: list[AssumedUnit] = Field(default_factory=list)
    satisfied: list[ExampleSignal] = Field(default_factory=list)
    violated: list[ExampleSignal] = Field(default_factory=list)


class ReadingsReply(_Reply):
    """All readings of the sentence, the most probable first."""

    readings: list[ReadingReply] = Field(max_length=MOST_READINGS)
    cannot: _Text = Field(default="", description="Why no formula says it; only if there are no readings.")


def readings_schema() -> dict[str, Any]:
    """Return the JSON Schema of a reply, within the subset of strict servers."""
    text = {"type": "string"}
    numbers = schema_of_list({"type": "number"})
    signals = schema_of_list(schema_of_object(name=text, times=numbers, values=numbers))
    reading = schema_of_object(
        formula=text,
        meaning=text,
        units=schema_of_list(schema_of_object(signal=text, unit=text)),
        satisfied=signals,
        violated=signals,
    )
    return schema_of_object(readings=schema_of_list(reading), cannot=text)


def read_readings(text: str) -> list[ReadingReply]:
    """Return the readings of a reply.

    Raises:
        RejectedReplyError: if it contains none, or they are not of the required form.
        SpecError: if it says that no formula can say it.
    """
    found = next((o for o in objects_in(text) if isinstance(o, dict) and "readings" in o), None)
    if found is None:
        raise RejectedReplyError('it contains no JSON object with "readings"')
    try:
        reply = ReadingsReply.model_validate(found)
    except ValidationError as error:
        raise RejectedReplyError(defect(error)) from None
    if not reply.readings:
        said = one_line(reply.cannot.strip()[:_LONGEST_MEANING])
        if not said:
            raise RejectedReplyError('it has neither "readings" nor a reason in "cannot"')
        raise SpecError(
            f"no formula was written, because the language model says: {said}\n{_WHAT_CANNOT_BE_SAID}"
        )
    return [r.model_copy(update={"meaning": r.meaning[:_LONGEST_MEANING]}) for r in reply.readings]


def example_trajectory(
    signals: Sequence[ExampleSignal], names: Sequence[str], times: np.ndarray[Any, np.dtype[np.float64]]
) -> Trajectory:
    """Return an example on a time grid; RejectedReplyError if signals are missing or out of order."""
    columns = {}
    for name in names:
        found = next((s for s in signals if s.name == name), None)
        if found is None:
            raise RejectedReplyError(f"an example lacks the signal {name!r}")
        if len(found.times) != len(found.values) or sorted(found.times) != found.times:
            raise RejectedReplyError(f"the example's signal {name!r} needs as many times as values, in order")
        columns[name] = np.interp(times, found.times, found.values)
    return Trajectory(times, columns)
