"""The record of a run: a directory of plain files that a killed run can be continued from.

::

    manifest.json        what was asked for, and with which versions; written once
    journal.jsonl        what happened, one JSON object a line, only ever appended to
    trajectories/N.npz   outputs and inputs of evaluation N; which ones are kept, Keep says
    lock                 held while a process writes here

Lines are written before and after every simulation and at every reply of a language model. A line that was
cut off by a crash is dropped when the journal is opened again. Nothing else reads or writes these files.
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

# Longest time in s that lines may wait in the operating system's cache before they are forced to disk;
# replies of a language model cost money and never wait.
_SYNC_PERIOD = 1.0
# Which trajectories are kept. history: those of the first evaluations all, later ones where they improve on
# the best; best: only the best one's, for campaigns of very many runs.
Keep = Literal["history", "best"]
_KEPT_TRAJECTORIES = 200
# Candidates are long: whoever only counts passes over these lines without parsing them.
_ASKED = b'{"kind":"asked"'


class Journal:
    """Writes one run directory, as a listener of the run; the only writer while it is open.

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
        (directory / TRAJECTORIES).mkdir(exist_ok=True)
        self._lock = FileLock(directory / LOCK)
        try:
            self._lock.acquire(timeout=patience)
        except Timeout:
            raise JournalError(f"{directory}: another process is writing this run") from None
        path = directory / JOURNAL
        _drop_torn_line(path)
        self.records = read_journal(directory)
        # A run that continues repeats what is recorded: so many events of each kind are not written again.
        self._standing = Counter(type(record) for record in self.records)
        self._file = path.open("a", encoding="utf-8")
        self._synced = monotonic()

    def __call__(self, event: Event) -> None:
        """Record what happened."""
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
        """Append a record, unless the journal holds it already."""
        if self._standing[type(record)]:
            self._standing[type(record)] -= 1
        else:
            self.write(record, at_once=at_once)

    def _evaluated(self, event: Evaluated) -> None:
        """Append an evaluation, and save its trajectory where it is one to keep."""
        if self._standing[EvaluatedRecord]:
            self._standing[EvaluatedRecord] -= 1
            return
        evaluation, name = event.evaluation, None
        every = self._keep == "history" and event.index < _KEPT_TRAJECTORIES
        if evaluation.trajectory is not None and (event.improved or every):
            name = f"{TRAJECTORIES}/{event.index}.npz"
            evaluation.trajectory.save(self.directory / name)
        self.write(
            EvaluatedRecord(
                index=event.index,
                status=evaluation.status,
                verdicts={who: VerdictRecord.of(e.verdict) for who, e in event.judged.items()},
                reason=evaluation.reason,
                seconds=evaluation.seconds,
                log=list(evaluation.log),
                trajectory=name,
            )
        )
        if name is not None and self._keep == "best":
            for path in (self.directory / TRAJECTORIES).glob("*.npz"):
                if path != self.directory / name:
                    path.unlink()


@contextmanager
def open_journal(directory: Path, *, keep: Keep = "history", patience: float = 0.0) -> Iterator[Journal]:
    """Journal of a run directory, closed at the end whatever happens; see Journal."""
    journal = Journal(directory, keep=keep, patience=patience)
    try:
        yield journal
    finally:
        journal.close()


def holds_run(directory: Path) -> bool:
    """Whether a directory is a run's."""
    return (directory / MANIFEST).exists()


def read_manifest(directory: Path) -> dict[str, Any]:
    """Read a run directory's manifest.

    Raises:
        JournalError: when there is none.
    """
    try:
        manifest: dict[str, Any] = json.loads((directory / MANIFEST).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise JournalError(f"{directory}: not a run directory, it has no {MANIFEST}") from None
    except json.JSONDecodeError as error:
        raise JournalError(f"{directory}/{MANIFEST}: not valid JSON: {error}") from None
    return manifest


def write_manifest(directory: Path, manifest: dict[str, Any]) -> None:
    """Write the manifest of a run directory."""
    write_whole(directory / MANIFEST, json.dumps(manifest, indent=2) + "\n")


def read_journal(directory: Path, *, with_candidates: bool = True) -> list[Record]:
    """Read all complete records of a run directory in order; empty where there is no journal.

    Args:
        directory: of the run.
        with_candidates: False: without the records of what engines were asked, which are long.

    Raises:
        JournalError: when a line other than a torn last one cannot be understood.
    """
    reader = JournalReader(directory, with_candidates=with_candidates)
    return list(reader.new())


class JournalReader:
    """Reads a growing journal.

    Args:
        directory: of the run, which need not have begun.
        with_candidates: see read_journal.
    """

    def __init__(self, directory: Path, *, with_candidates: bool = True) -> None:
        self.path = directory / JOURNAL
        self.offset = 0
        self.line = 0
        self._with_candidates = with_candidates

    @property
    def shrank(self) -> bool:
        """Whether the file is shorter than what was read: begin again with another reader."""
        return self.path.exists() and self.path.stat().st_size < self.offset

    @property
    def begun(self) -> bool:
        """Whether anything was read."""
        return self.offset > 0

    def new(self) -> Iterator[Record]:
        """Yield the complete records that were written since the last time.

        Raises:
            JournalError: when a line cannot be understood.
        """
        if not self.path.exists() or self.path.stat().st_size == self.offset:
            return
        with self.path.open("rb") as file:
            file.seek(self.offset)
            for line in file:
                if not line.endswith(b"\n"):  # torn, or still being written
                    return
                self.offset += len(line)
                self.line += 1
                if self._with_candidates or not line.startswith(_ASKED):
                    yield self._parsed(line)

    def _parsed(self, line: bytes) -> Record:
        try:
            return RECORDS.validate_json(line)
        except ValidationError as error:
            said = error.errors()[0]["msg"]
            raise JournalError(f"{self.path}: line {self.line} is damaged: {said}") from None


def recorded_exchanges(records: Iterable[Record]) -> list[Exchange]:
    """Recorded exchanges with a language model, in order."""
    return [Exchange.model_validate(r.exchange) for r in records if isinstance(r, ExchangeRecord)]


def recorded_candidates(records: Iterable[Record]) -> dict[int, Candidate]:
    """Candidates by the index of their evaluation."""
    return {
        record.first + i: Candidate.from_json(candidate)
        for record in records
        if isinstance(record, AskedRecord)
        for i, candidate in enumerate(record.candidates)
    }


def recorded_evaluations(
    directory: Path, records: Sequence[Record], requirement: str | None = None
) -> list[Evaluation]:
    """Finished evaluations in order, each with its trajectory where it was kept.

    Args:
        directory: of the run.
        records: of its journal.
        requirement: who judges; default: the one whose turn it was.
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
    """Trajectory of a record; None where it was not kept."""
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
