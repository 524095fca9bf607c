"""The record of a run: a directory of plain files from which even a killed run can be resumed.

::

    manifest.json        what was requested, with which versions; written once
    journal.jsonl        what happened, one JSON object per line, append-only
    trajectories/N.npz   outputs and inputs of evaluation N; Keep decides which ones are kept
    lock                 held while a process writes here

Lines are written before and after every simulation and after every reply of a language model. A last line
that a crash left incomplete is dropped when the journal is opened again. No other module reads or writes
these files.
"""

import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from time import monotonic
from typing import Any, Literal

from filelock import FileLock, Timeout
from pydantic import ValidationError

from falsifier.core.candidate import Candidate
from falsifier.core.files import write_whole
from falsifier.core.trajectory import Trajectory
from falsifier.errors import JournalError
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.messages import Exchange
from falsifier.search.events import Asked, Confirmed, Evaluated, Event, Exchanged, RunEnded
from falsifier.search.records import (
    RECORDS,
    AskedRecord,
    ConfirmedRecord,
    EndedRecord,
    EvaluatedRecord,
    ExchangeRecord,
    Record,
    VerdictRecord,
)

MANIFEST = "manifest.json"
JOURNAL = "journal.jsonl"
TRAJECTORIES = "trajectories"
LOCK = "lock"

# Maximum time in s that lines may stay in the operating system's cache before they are forced to disk;
# replies of a language model cost money and are forced to disk at once.
_SYNC_PERIOD = 1.0
# Which trajectories are kept. history: the first _KEPT_TRAJECTORIES, then each that improves on the best;
# best: only the best one, for campaigns of very many runs.
Keep = Literal["history", "best"]
_KEPT_TRAJECTORIES = 200
# Lines with candidates are long; readers that only count skip them by this prefix, without parsing.
_ASKED = b'{"kind":"asked"'


class Journal:
    """Writes one run directory as a listener of the run; the only writer while it is open.

    Args:
        directory: run directory; created if missing.
        keep: which trajectories are kept.
        patience: time in s to wait for another process that writes here.

    Raises:
        JournalError: if another process still writes here after that time.
    """

    def __init__(self, directory: Path, *, keep: Keep = "history", patience: float = 0.0) -> None:
        self.directory = directory
        self._keep = keep
        directory.mkdir(parents=True, exist_ok=True)
        (directory / TRAJECTORIES).mkdir(exist_ok=True)
        self._lock = FileLock(directory / LOCK)
        try:
            self._lock.acquire(timeout=patience)
        except Timeout:
            raise JournalError(
                f"{directory}: another process is writing to this run; wait until it ends"
            ) from None
        path = directory / JOURNAL
        _drop_torn_line(path)
        self.records = read_journal(directory)
        # A resumed run repeats the events that are recorded already; this many of each kind are not written.
        self._recorded = Counter(type(record) for record in self.records)
        self._file = path.open("a", encoding="utf-8")
        self._synced = monotonic()

    def __call__(self, event: Event) -> None:
        """Record an event."""
        match event:
            case Asked():
                self._add(
                    AskedRecord(
                        first=event.first,
                        n=event.wanted,
                        candidates=[c.to_json() for c in event.candidates],
                        seconds=event.seconds,
                        requirement=event.problem.name,
                    )
                )
            case Exchanged():
                exchange = event.exchange.model_dump(mode="json")
                self._add(ExchangeRecord(exchange=exchange), at_once=True)
            case Evaluated():
                self._evaluated(event)
            case Confirmed():
                record = ConfirmedRecord.of(event.confirmation, index=event.index, spent=event.spent)
                self._add(record, at_once=True)
            case RunEnded():
                ended = EndedRecord(status=event.status, reason=event.reason, spent=asdict(event.spent))
                self.write(ended, at_once=True)
            case _:
                pass

    def write(self, record: Record, *, at_once: bool = False) -> None:
        """Append a record; at_once forces it to disk before returning."""
        self._file.write(record.model_dump_json() + "\n")
        self._file.flush()
        if at_once or monotonic() - self._synced > _SYNC_PERIOD:
            os.fsync(self._file.fileno())
            self._synced = monotonic()

    def close(self) -> None:
        """Force everything to disk and let others write here."""
        with suppress(ValueError):
            self._file.flush()
            os.fsync(self._file.fileno())
        self._file.close()
        self._lock.release()

    def _add(self, record: Record, *, at_once: bool = False) -> None:
        """Append a record, unless the journal contains it already."""
        if self._recorded[type(record)]:
            self._recorded[type(record)] -= 1
        else:
            self.write(record, at_once=at_once)

    def _evaluated(self, event: Evaluated) -> None:
        """Append an evaluation, and save its trajectory if it is one to keep."""
        if self._recorded[EvaluatedRecord]:
            self._recorded[EvaluatedRecord] -= 1
            return
        evaluation, file = event.evaluation, None
        every = self._keep == "history" and event.index < _KEPT_TRAJECTORIES
        if evaluation.trajectory is not None and (event.improved or every):
            file = f"{TRAJECTORIES}/{event.index}.npz"
            evaluation.trajectory.save(self.directory / file)
        self.write(
            EvaluatedRecord(
                index=event.index,
                status=evaluation.status,
                verdicts={name: VerdictRecord.of(e.verdict) for name, e in event.judged.items()},
                reason=evaluation.reason,
                seconds=evaluation.seconds,
                log=list(evaluation.log),
                trajectory=file,
            )
        )
        # Only after the record: a crash in between must not lose the trajectory that the journal refers to.
        if file is not None and self._keep == "best":
            for path in (self.directory / TRAJECTORIES).glob("*.npz"):
                if path != self.directory / file:
                    path.unlink()


@contextmanager
def open_journal(directory: Path, *, keep: Keep = "history", patience: float = 0.0) -> Iterator[Journal]:
    """Open the journal of a run directory, and close it even after an exception; see Journal."""
    journal = Journal(directory, keep=keep, patience=patience)
    try:
        yield journal
    finally:
        journal.close()


def holds_run(directory: Path) -> bool:
    """Whether a directory contains a run."""
    return (directory / MANIFEST).exists()


def read_manifest(directory: Path) -> dict[str, Any]:
    """Read a run directory's manifest as plain JSON.

    Raises:
        JournalError: if there is none, or it is not valid JSON.
    """
    try:
        manifest: dict[str, Any] = json.loads((directory / MANIFEST).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise JournalError(f"{directory}: not a run directory: it contains no {MANIFEST}") from None
    except json.JSONDecodeError as error:
        raise JournalError(f"{directory}/{MANIFEST}: not valid JSON: {error}") from None
    return manifest


def write_manifest(directory: Path, manifest: dict[str, Any]) -> None:
    """Write the manifest of a run directory."""
    write_whole(directory / MANIFEST, json.dumps(manifest, indent=2) + "\n")


def read_journal(directory: Path, *, with_candidates: bool = True) -> list[Record]:
    """Read all complete records of a run directory in order; empty if there is no journal.

    Args:
        directory: run directory.
        with_candidates: False: skip the records of what engines suggested, which are long.

    Raises:
        JournalError: if a line is invalid, unless it is an incomplete last line.
    """
    reader = JournalReader(directory, with_candidates=with_candidates)
    return list(reader.new())


class JournalReader:
    """Reads a journal that is still growing.

    Args:
        directory: run directory; the run need not have started.
        with_candidates: see read_journal.
    """

    def __init__(self, directory: Path, *, with_candidates: bool = True) -> None:
        self.path = directory / JOURNAL
        self.offset = 0
        self.line = 0
        self._with_candidates = with_candidates

    @property
    def shrank(self) -> bool:
        """Whether the file is shorter than what was read; then start again with a new reader."""
        return self.path.exists() and self.path.stat().st_size < self.offset

    @property
    def begun(self) -> bool:
        """Whether anything has been read."""
        return self.offset > 0

    def new(self) -> Iterator[Record]:
        """Yield the complete records written since the last call.

        Raises:
            JournalError: if a line is invalid.
        """
        if not self.path.exists() or self.path.stat().st_size == self.offset:
            return
        with self.path.open("rb") as file:
            file.seek(self.offset)
            for line in file:
                if not line.endswith(b"\n"):  # cut off by a crash, or still being written
                    return
                self.offset += len(line)
                self.line += 1
                if self._with_candidates or not line.startswith(_ASKED):
                    yield self._parsed(line)

    def _parsed(self, line: bytes) -> Record:
        try:
            return RECORDS.validate_json(line)
        except ValidationError as error:
            message = error.errors()[0]["msg"]
            raise JournalError(f"{self.path}: line {self.line} is damaged: {message}") from None


def recorded_exchanges(records: Iterable[Record]) -> list[Exchange]:
    """Recorded exchanges with a language model, in order."""
    return [Exchange.model_validate(r.exchange) for r in records if isinstance(r, ExchangeRecord)]


def recorded_candidates(records: Iterable[Record]) -> dict[int, Candidate]:
    """Recorded candidates by the index of their evaluation."""
    return {
        record.first + i: Candidate.from_json(candidate)
        for record in records
        if isinstance(record, AskedRecord)
        for i, candidate in enumerate(record.candidates)
    }


def recorded_evaluations(
    directory: Path, records: Sequence[Record], requirement: str | None = None
) -> list[Evaluation]:
    """Recorded evaluations in order, each with its trajectory if that was kept.

    Args:
        directory: run directory.
        records: records of its journal.
        requirement: name of the requirement whose verdicts to return; None: of each evaluation, the
            requirement whose engine suggested the candidate.
    """
    candidates = recorded_candidates(records)
    turn: dict[int, str] = {}
    evaluations = []
    for record in records:
        if isinstance(record, AskedRecord):
            turn |= dict.fromkeys(
                range(record.first, record.first + len(record.candidates)), record.requirement
            )
        elif isinstance(record, EvaluatedRecord):
            verdict = record.verdicts.get(requirement or turn[record.index])
            evaluations.append(
                Evaluation(
                    candidates[record.index],
                    record.status,
                    verdict.verdict if verdict else None,
                    record.reason,
                    recorded_trajectory(directory, record.trajectory),
                    record.seconds,
                    tuple(record.log),
                )
            )
    return evaluations


def recorded_trajectory(directory: Path, name: str | None) -> Trajectory | None:
    """Load the trajectory of a record; None if it was not kept."""
    path = directory / (name or "-")
    return Trajectory.load(path) if path.is_file() else None


def _drop_torn_line(path: Path) -> None:
    if not path.exists():
        return
    content = path.read_bytes()
    end = content.rfind(b"\n") + 1
    if end < len(content):
        with path.open("r+b") as file:
            file.truncate(end)
