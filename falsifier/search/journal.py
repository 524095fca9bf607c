"""The record of a run: a directory of plain files that a killed run can be continued from.

::

    manifest.json        what was asked for, and with which versions; written once
    journal.jsonl        what happened, one JSON object a line, only ever appended to
    trajectories/N.npz   outputs and inputs of evaluation N; which ones are kept, Keep says
    lock                 held while a process writes here

Lines are written before and after every simulation and at every reply of a language model. A line that was
cut off by a crash is dropped when the journal is opened again.
"""

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any, Literal

from filelock import FileLock, Timeout
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from falsifier.core.candidate import Candidate
from falsifier.core.trajectory import Trajectory
from falsifier.errors import JournalError
from falsifier.evaluation.evaluate import Evaluation, Status
from falsifier.stl.verdict import Verdict

if TYPE_CHECKING:
    from falsifier.llm.messages import Exchange

# Longest time in s that lines may wait in the operating system's cache before they are forced to disk;
# replies of a language model cost money and never wait.
_SYNC_PERIOD = 1.0
# Which trajectories are kept. history: those of the first evaluations all, later ones where they improve on
# the best; best: only the best one's, for campaigns of very many runs.
Keep = Literal["history", "best"]
_KEPT_TRAJECTORIES = 200


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class AskedRecord(_Record):
    """The engine was asked for n candidates and gave these, as evaluations first, first + 1, ..."""

    kind: Literal["asked"] = "asked"
    first: int
    n: int
    candidates: list[dict[str, Any]]
    seconds: float
    requirement: str = Field("", description="Whose turn it was, where several are falsified together.")


class VerdictRecord(_Record):
    """A verdict."""

    robustness: float = Field(allow_inf_nan=False)
    critical_time: float
    predicate: str
    values: dict[str, float]

    @classmethod
    def of(cls, verdict: Verdict | None) -> "VerdictRecord | None":
        """Return the record of a verdict, None where there is none."""
        if verdict is None:
            return None
        return cls(
            robustness=verdict.robustness,
            critical_time=verdict.critical_time,
            predicate=verdict.predicate,
            values=dict(verdict.values),
        )


class EvaluatedRecord(_Record):
    """Evaluation index has ended."""

    kind: Literal["evaluated"] = "evaluated"
    index: int
    status: Status
    verdict: VerdictRecord | None
    reason: str = ""
    seconds: float
    log: list[str] = []
    trajectory: str | None = Field(None, description="File below the run directory.")
    verdicts: dict[str, VerdictRecord | None] | None = Field(
        None, description="Of every requirement that stood, where several are falsified together."
    )


class ExchangeRecord(_Record):
    """A language model was asked and answered."""

    kind: Literal["exchange"] = "exchange"
    exchange: dict[str, Any]


class ConfirmedRecord(_Record):
    """A violation was checked."""

    kind: Literal["confirmed"] = "confirmed"
    index: int
    outcome: str
    robustness: float | None
    reference: float | None
    reason: str
    halved: float | None = None
    requirement: str = Field("", description="Which one, where several are falsified together.")
    spent: dict[str, float | None] | None = Field(
        None, description="What the run had used by then, where several are falsified together."
    )


class EndedRecord(_Record):
    """The run ended, or was interrupted."""

    kind: Literal["ended"] = "ended"
    status: str
    reason: str
    spent: dict[str, float | None]


Record = AskedRecord | EvaluatedRecord | ExchangeRecord | ConfirmedRecord | EndedRecord
RECORDS: TypeAdapter[Record] = TypeAdapter(Annotated[Record, Field(discriminator="kind")])


class Journal:
    """Writes one run directory; the only writer while it is open.

    Args:
        directory: made where it is missing.
        keep: which trajectories are kept.
        patience: how long in s to wait for another process that writes here.

    Raises:
        JournalError: when another process still writes here after that time.
    """

    def __init__(self, directory: Path, *, keep: Keep = "history", patience: float = 0.0) -> None:
        self.directory = directory
        self._keep = keep
        directory.mkdir(parents=True, exist_ok=True)
        (directory / "trajectories").mkdir(exist_ok=True)
        self._lock = FileLock(directory / "lock")
        try:
            self._lock.acquire(timeout=patience)
        except Timeout:
            raise JournalError(f"{directory}: another process is writing this run") from None
        _drop_torn_line(directory / "journal.jsonl")
        self._file = (directory / "journal.jsonl").open("a", encoding="utf-8")
        self._synced = monotonic()

    def write(self, record: Record, *, at_once: bool = False) -> None:
        """Append a record; at_once forces it to disk before returning."""
        self._file.write(record.model_dump_json() + "\n")
        self._file.flush()
        if at_once or monotonic() - self._synced > _SYNC_PERIOD:
            os.fsync(self._file.fileno())
            self._synced = monotonic()

    def evaluated(
        self,
        index: int,
        evaluation: Evaluation,
        *,
        improved: bool,
        verdicts: Mapping[str, Verdict | None] | None = None,
    ) -> None:
        """Append an evaluation, and save its trajectory where it is one to keep.

        Args:
            index: of the evaluation.
            evaluation: judged by the requirement whose turn it was.
            improved: whether it is the best so far.
            verdicts: by requirement, where several are falsified together.
        """
        name = None
        every = self._keep == "history" and index < _KEPT_TRAJECTORIES
        if evaluation.trajectory is not None and (improved or every):
            name = f"trajectories/{index}.npz"
            evaluation.trajectory.save(self.directory / name)
        self.write(
            EvaluatedRecord(
                index=index,
                status=evaluation.status,
                verdict=VerdictRecord.of(evaluation.verdict),
                reason=evaluation.reason,
                seconds=evaluation.seconds,
                log=list(evaluation.log),
                trajectory=name,
                verdicts=None
                if verdicts is None
                else {who: VerdictRecord.of(verdict) for who, verdict in verdicts.items()},
            )
        )
        if name is not None and self._keep == "best":
            for path in (self.directory / "trajectories").glob("*.npz"):
                if path != self.directory / name:
                    path.unlink()

    def close(self) -> None:
        """Force everything to disk and let others write here."""
        with suppress(ValueError):
            self._file.flush()
            os.fsync(self._file.fileno())
        self._file.close()
        self._lock.release()


@contextmanager
def open_journal(directory: Path, *, keep: Keep = "history", patience: float = 0.0) -> Iterator[Journal]:
    """Journal of a run directory, closed at the end whatever happens; see Journal."""
    journal = Journal(directory, keep=keep, patience=patience)
    try:
        yield journal
    finally:
        journal.close()


def read_journal(directory: Path) -> list[Record]:
    """Read all complete records of a run directory in order; empty where there is no journal.

    Raises:
        JournalError: when a line other than a torn last one cannot be understood.
    """
    path = directory / "journal.jsonl"
    if not path.exists():
        return []
    lines = path.read_bytes().split(b"\n")
    records = []
    for number, line in enumerate(lines[:-1], start=1):  # what follows the last newline is torn or empty
        try:
            records.append(RECORDS.validate_json(line))
        except ValidationError as error:
            raise JournalError(f"{path}: line {number} is damaged: {error.errors()[0]['msg']}") from None
    return records


def read_manifest(directory: Path) -> dict[str, Any]:
    """Read a run directory's manifest.

    Raises:
        JournalError: when there is none.
    """
    try:
        manifest: dict[str, Any] = json.loads((directory / "manifest.json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise JournalError(f"{directory}: not a run directory, it has no manifest.json") from None
    except json.JSONDecodeError as error:
        raise JournalError(f"{directory}/manifest.json: not valid JSON: {error}") from None
    return manifest


def write_manifest(directory: Path, manifest: dict[str, Any]) -> None:
    """Write the manifest of a run directory."""
    write_whole(directory / "manifest.json", json.dumps(manifest, indent=2) + "\n")


def write_whole(path: Path, text: str) -> None:
    """Write a file in one step, so that a crash leaves the whole of it or none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.partial")
    with partial.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)


def recorded_exchanges(records: Iterable[Record]) -> list["Exchange"]:
    """Recorded exchanges with a language model, in order."""
    from falsifier.llm.messages import Exchange

    return [Exchange.model_validate(r.exchange) for r in records if isinstance(r, ExchangeRecord)]


def recorded_evaluations(directory: Path, records: list[Record]) -> list[Evaluation]:
    """Finished evaluations in order, each with its trajectory where it was kept."""
    candidates: dict[int, Candidate] = {}
    evaluations = []
    for record in records:
        if isinstance(record, AskedRecord):
            for i, candidate in enumerate(record.candidates):
                candidates[record.first + i] = Candidate.from_json(candidate)
        elif isinstance(record, EvaluatedRecord):
            evaluations.append(_evaluation(directory, candidates[record.index], record))
    return evaluations


def _evaluation(directory: Path, candidate: Candidate, record: EvaluatedRecord) -> Evaluation:
    path = directory / record.trajectory if record.trajectory else None
    found = record.verdict
    verdict = Verdict(found.robustness, found.critical_time, found.predicate, found.values) if found else None
    return Evaluation(
        candidate,
        record.status,
        verdict,
        record.reason,
        Trajectory.load(path) if path is not None and path.exists() else None,
        record.seconds,
        tuple(record.log),
    )


def _drop_torn_line(path: Path) -> None:
    if not path.exists():
        return
    content = path.read_bytes()
    end = content.rfind(b"\n") + 1
    if end < len(content):
        with path.open("r+b") as file:
            file.truncate(end)
