"""The lines of a journal as typed records."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field, PlainSerializer, PlainValidator, TypeAdapter, ValidationError

from falsifier.core.candidate import Candidate
from falsifier.core.files import seal
from falsifier.core.strict import Strict
from falsifier.errors import SpecError, first_fault
from falsifier.evaluation.confirm import Confirmation, Outcome
from falsifier.evaluation.evaluate import Evaluation, Status
from falsifier.llm.messages import Exchange
from falsifier.problem.problem import Problem
from falsifier.record.files import TRAJECTORIES, TRAJECTORY_NAMES
from falsifier.search.budget import Spent
from falsifier.search.findings import Finding
from falsifier.search.result import ResultStatus
from falsifier.stl.monitor import Verdict

_ELAPSED = Field(description="Wall-clock time of the run in s when the line was written.")


def _candidate(recorded: Candidate | dict[str, Any]) -> Candidate:
    try:
        return recorded if isinstance(recorded, Candidate) else Candidate.from_json(recorded)
    except SpecError as error:
        raise ValueError(str(error)) from None


_RecordedCandidate = Annotated[
    Candidate,
    PlainValidator(_candidate, json_schema_input_type=dict[str, Any]),
    PlainSerializer(Candidate.to_json, return_type=dict[str, Any]),
]


class _Record(Strict):
    # The values in it are checked alike.
    model_config = ConfigDict(allow_inf_nan=False)

    line: int = Field(0, description="Number of the line, from 1; 0 before it is written.")
    run: str = Field("", description="Name of the run that wrote the line, as in its manifest.")
    sum: str = Field("", description="Checksum of the line up to the comma before it.")


class AskedRecord(_Record):
    """An engine was asked for n candidates and suggested these: evaluations first, first + 1, ..."""

    kind: Literal["asked"] = "asked"
    first: int
    n: int
    candidates: list[_RecordedCandidate]
    seconds: float
    requirement: str = Field(description="Requirement whose engine was asked.")
    elapsed: float = _ELAPSED


class EvaluatedRecord(_Record):
    """An evaluation ended."""

    kind: Literal["evaluated"] = "evaluated"
    index: int
    status: Status
    verdicts: dict[str, Verdict | None] = Field(
        description="Verdict on each requirement not yet falsified, by name; null if it could not be judged. "
        "A robustness below 0 is a violation; on the limit it is -1e-300 if that is one, else 1e-300."
    )
    reason: str = ""
    seconds: float
    log: list[str] = Field([])
    trajectory: str | None = Field(
        None,
        pattern=rf"^{TRAJECTORIES}/{TRAJECTORY_NAMES}$",
        description="File, relative to the run directory.",
    )
    elapsed: float = _ELAPSED

    def evaluation(self, candidate: Candidate, requirement: str) -> Evaluation:
        """Return what was recorded, without the trajectory, given the candidate and who judges."""
        verdict, log = self.verdicts.get(requirement), tuple(self.log)
        status, reason = self.status, self.reason  # for the requirement whose engine suggested the candidate
        if verdict is not None:
            status, reason = "ok", ""
        elif status == "ok":
            status, reason = "failed", f"{requirement} could not be judged"
        return Evaluation(candidate, status, verdict, reason, seconds=self.seconds, log=log)


class ExchangeRecord(_Record):
    """A request was sent to a language model and answered."""

    kind: Literal["exchange"] = "exchange"
    exchange: Exchange
    elapsed: float = _ELAPSED


class ConfirmedRecord(_Record):
    """A violation was simulated again and judged by a second monitor."""

    # What it has of a confirmation.
    shared: ClassVar[tuple[str, ...]] = ("outcome", "robustness", "reference", "reason", "halved")

    kind: Literal["confirmed"] = "confirmed"
    index: int
    requirement: str
    outcome: Outcome
    robustness: float | None
    reference: float | None
    reason: str
    halved: float | None = None
    spent: Spent = Field(description="What the run had spent by then.")

    @classmethod
    def of(cls, confirmation: Confirmation, *, index: int, spent: Spent) -> "ConfirmedRecord":
        """Return the record of a confirmation."""
        shared = {name: getattr(confirmation, name) for name in cls.shared}
        return cls(index=index, requirement=confirmation.problem.name, spent=spent, **shared)

    def confirmation(self, problem: Problem, evaluation: Evaluation) -> Confirmation:
        """Return what was recorded, given the problem and the evaluation that violates its requirement."""
        shared = {name: getattr(self, name) for name in self.shared}
        return Confirmation(problem=problem, evaluation=evaluation, **shared)


class EndedRecord(_Record):
    """The run ended or was interrupted."""

    kind: Literal["ended"] = "ended"
    status: ResultStatus
    reason: str
    spent: Spent
    findings: dict[str, list[Finding]] = Field(
        default_factory=dict,
        description="What the search could not show, by name of each requirement that was not falsified.",
    )


Record = AskedRecord | EvaluatedRecord | ExchangeRecord | ConfirmedRecord | EndedRecord
RECORDS: TypeAdapter[Record] = TypeAdapter(Annotated[Record, Field(discriminator="kind")])


def line_of(record: Record, number: int, run: str = "") -> bytes:
    """Return the line of a run's journal with this number, from 1, with its checksum."""
    numbered = record.model_copy(update={"line": number, "run": run})
    return seal(numbered.model_dump_json(exclude={"sum"})).encode()


def parse_line(line: bytes, number: int, run: str | None = None) -> Record:
    """Return the record of a line whose checksum is right, and which must have this number and run, if known.

    Raises:
        ValueError: if it is none, or has another number or run; the message says which.
    """
    try:
        record = RECORDS.validate_json(line)
    except ValidationError as error:
        raise ValueError(": ".join(filter(None, first_fault(error)))) from None
    if run not in (None, record.run):
        raise ValueError("it was written by another run than the one that manifest.json describes")
    if record.line != number:
        raise ValueError(f"expected line {number}, found line {record.line}: lines are missing or doubled")
    return record


def elapsed_at(record: Record) -> float:
    """Wall-clock time of the run in s when a record was written."""
    return record.spent.seconds if isinstance(record, ConfirmedRecord | EndedRecord) else record.elapsed
