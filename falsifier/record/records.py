"""The lines of a journal as typed records."""

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from falsifier.core.files import check_seal, seal
from falsifier.evaluation.confirm import Confirmation, Outcome
from falsifier.evaluation.evaluate import Status
from falsifier.search.budget import Spent
from falsifier.search.findings import Finding, FindingKind
from falsifier.stl import Breach
from falsifier.stl.verdict import Verdict

_ELAPSED = Field(description="Wall-clock time of the run in s when the line was written.")


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    line: int = Field(0, description="Number of the line, from 1; 0 before it is written.")
    sum: str = Field("", description="Checksum of the line up to here.")


class AskedRecord(_Record):
    """An engine was asked for n candidates and suggested these: evaluations first, first + 1, ..."""

    kind: Literal["asked"] = "asked"
    first: int
    n: int
    candidates: list[dict[str, Any]]
    seconds: float
    requirement: str = Field(description="Requirement whose engine was asked.")
    elapsed: float = _ELAPSED


class VerdictRecord(_Record):
    """Robustness, and what decided it."""

    robustness: float = Field(
        allow_inf_nan=False,
        description="Below 0: violated. Exactly on the limit, -1e-300 if that is a violation, else 1e-300.",
    )
    critical_time: float
    predicate: str
    values: dict[str, float]
    breach: Breach | None = Field(None, description="What broke; null if nothing did.")

    @classmethod
    def of(cls, verdict: Verdict | None) -> "VerdictRecord | None":
        """Return the record of a verdict; None without a verdict."""
        if verdict is None:
            return None
        return cls(
            robustness=verdict.robustness,
            critical_time=verdict.critical_time,
            predicate=verdict.predicate,
            values=dict(verdict.values),
            breach=verdict.breach,
        )

    @property
    def verdict(self) -> Verdict:
        """The verdict that was recorded."""
        return Verdict(self.robustness, self.critical_time, self.predicate, self.values, self.breach)


class EvaluatedRecord(_Record):
    """An evaluation ended."""

    kind: Literal["evaluated"] = "evaluated"
    index: int
    status: Status
    verdicts: dict[str, VerdictRecord | None] = Field(
        description="Verdict on each requirement not yet falsified, by name; null if it could not be judged."
    )
    reason: str = ""
    seconds: float
    log: list[str] = []
    trajectory: str | None = Field(None, description="File, relative to the run directory.")
    elapsed: float = _ELAPSED


class ExchangeRecord(_Record):
    """A request was sent to a language model and answered."""

    kind: Literal["exchange"] = "exchange"
    exchange: dict[str, Any]
    elapsed: float = _ELAPSED


class ConfirmedRecord(_Record):
    """A violation was simulated again and judged by a second monitor."""

    kind: Literal["confirmed"] = "confirmed"
    index: int
    requirement: str
    outcome: Outcome
    robustness: float | None
    reference: float | None
    reason: str
    halved: float | None = None
    spent: dict[str, float | None] = Field(description="What the run had spent by then.")

    @classmethod
    def of(cls, confirmation: Confirmation, *, index: int, spent: Spent) -> "ConfirmedRecord":
        """Return the record of a confirmation."""
        return cls(
            index=index,
            requirement=confirmation.problem.name,
            outcome=confirmation.outcome,
            robustness=confirmation.robustness,
            reference=confirmation.reference,
            reason=confirmation.reason,
            halved=confirmation.halved,
            spent=asdict(spent),
        )


class FindingRecord(BaseModel):
    """One thing that the search could not show about a requirement."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    kind: FindingKind
    text: str
    part: str = Field("", description="Part of the formula, or input, that it is about.")
    margin: float | None = Field(None, allow_inf_nan=False, description="How far the part was from changing.")
    time: float | None = Field(None, description="When it came closest, in s.")
    simulation: int | None = Field(None, description="Index of the evaluation in which it came closest.")

    @property
    def finding(self) -> Finding:
        """The finding that was recorded."""
        return Finding(**self.model_dump())


class EndedRecord(_Record):
    """The run ended or was interrupted."""

    kind: Literal["ended"] = "ended"
    status: str
    reason: str
    spent: dict[str, float | None]
    findings: dict[str, list[FindingRecord]] = Field(
        default_factory=dict,
        description="What the search could not show, by name of each requirement that was not falsified.",
    )


Record = AskedRecord | EvaluatedRecord | ExchangeRecord | ConfirmedRecord | EndedRecord
RECORDS: TypeAdapter[Record] = TypeAdapter(Annotated[Record, Field(discriminator="kind")])


def line_of(record: Record, number: int) -> bytes:
    """Return the line of a journal with this number, from 1, with its checksum."""
    numbered = record.model_copy(update={"line": number})
    return seal(numbered.model_dump_json(exclude={"sum"})).encode()


def parse_line(line: bytes, number: int | None = None) -> Record:
    """Return the record of a line.

    Args:
        line: the line.
        number: number that it must have; None: any.

    Raises:
        ValueError: if it is damaged; the message says how.
    """
    check_seal(line)
    try:
        record = RECORDS.validate_json(line)
    except ValidationError as error:
        raise ValueError(error.errors()[0]["msg"]) from None
    if number is not None and record.line != number:
        raise ValueError(f"expected line {number}, found line {record.line}: lines are missing or doubled")
    return record


def elapsed_at(record: Record) -> float:
    """Wall-clock time of the run in s when a record was written."""
    if isinstance(record, ConfirmedRecord | EndedRecord):
        return spent_of(record.spent).seconds
    return record.elapsed


def spent_of(recorded: Mapping[str, float | None]) -> Spent:
    """Rebuild Spent from its record, in which all numbers are floats."""
    whole = {f.name for f in fields(Spent) if f.type is int}
    numbers = {name: int(v) if name in whole and v is not None else v for name, v in recorded.items()}
    return Spent(**numbers)  # type: ignore[arg-type]
