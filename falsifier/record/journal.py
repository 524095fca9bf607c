"""The record of a run: a directory of plain files from which even a killed run can be resumed.

::

    manifest.json            what was requested, with which versions; written before the first line
    journal.jsonl            what happened, one JSON object per line, append-only
    trajectories/N-SUM.npz   outputs and inputs of evaluation N; Keep decides which ones are kept
    lock                     held while a process writes here
    stop                     whoever writes it asks that process to stop, as Ctrl-C does

Lines are written before and after every simulation and after every reply of a language model. A last line
that a crash left incomplete is dropped when the journal is opened again. The manifest and every line end with
a checksum, lines are numbered and name their run, and SUM in the name of a trajectory is that file's
checksum: damage is noticed. ``manifest`` and ``files`` have the other files; ``repair`` drops damage.
"""

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import cached_property, lru_cache
from pathlib import Path
from time import monotonic

from falsifier.core.candidate import Candidate
from falsifier.core.files import check_seal, remove_partial
from falsifier.core.literals import one_line, shell_word
from falsifier.errors import JournalError, written
from falsifier.evaluation.evaluate import Evaluation
from falsifier.record import files, manifest
from falsifier.record.records import (
    AskedRecord,
    ConfirmedRecord,
    EndedRecord,
    EvaluatedRecord,
    ExchangeRecord,
    Record,
    line_of,
    parse_line,
)
from falsifier.record.replay import played_back
from falsifier.search.events import Asked, Confirmed, Evaluated, Event, Exchanged, RunEnded
from falsifier.search.request import Keep

JOURNAL = "journal.jsonl"
LOCK = "lock"
STOP = "stop"

# Maximum time in s that lines may stay in the operating system's cache before they are forced to disk.
_SYNC_PERIOD = 1.0
# These are forced to disk at once: replies of a language model cost money, the others are results.
_AT_ONCE = (ExchangeRecord, ConfirmedRecord, EndedRecord)
# With Keep "history" the first so many trajectories are kept, and those of simulations that took longer than
# so many s, until all take so many bytes; and each that improves on the best.
_KEPT_TRAJECTORIES, _SLOW, _KEPT_BYTES = 200, 1.0, 1_000_000_000


class Journal:
    """Writes one run directory, whose lock is held, as a listener of the run; made by open_journal."""

    def __init__(self, directory: Path, keep: Keep) -> None:
        self.directory = directory
        self._keep = keep
        remove_partial(directory / files.TRAJECTORIES, files.TRAJECTORY_NAMES)
        remove_partial(directory, re.escape(manifest.MANIFEST))
        self._reader = JournalReader(directory)
        self.records = list(self._reader.new())
        self._file = self._reader.path.open("ab", buffering=0)
        self._file.truncate(self._reader.offset)  # drops a line that a crash left incomplete
        # A resumed run repeats the events that are recorded already; they are not written again.
        self._recorded = Counter(map(_key, self.records))
        self._recorded["exchange",] = len(played_back(self.records)[0])  # the others are asked again
        self._kept_bytes = sum(p.stat().st_size for p in (directory / files.TRAJECTORIES).glob("*.npz"))
        self._synced = monotonic()

    def __call__(self, event: Event) -> None:
        """Record an event."""
        match event:
            case Asked():
                self._add(
                    AskedRecord(
                        first=event.first,
                        n=event.wanted,
                        candidates=list(event.candidates),
                        seconds=event.seconds,
                        requirement=event.problem.name,
                        elapsed=event.spent.seconds,
                    )
                )
            case Exchanged():
                self._add(ExchangeRecord(exchange=event.exchange, elapsed=event.spent.seconds))
            case Evaluated():
                self._evaluated(event)
            case Confirmed():
                self._add(ConfirmedRecord.of(event.confirmation, index=event.index, spent=event.spent))
            case RunEnded() if event.status in ("interrupted", "failed") and self._is_repeating:
                pass  # it has spent what is recorded, and that is more than it has repeated
            case RunEnded():
                findings = {r.problem.name: list(r.findings) for r in event.results if r.findings}
                self.write(
                    EndedRecord(
                        status=event.status, reason=event.reason, spent=event.spent, findings=findings
                    )
                )

    def write(self, record: Record) -> None:
        """Append a record; OSError if it cannot be written, of which nothing remains, or the file is gone."""
        size = self._file.seek(0, os.SEEK_END)
        is_due = isinstance(record, _AT_ONCE) or monotonic() - self._synced > _SYNC_PERIOD
        if is_due:
            self._reader.path.stat()  # what is written to a file that was deleted or moved, nobody finds
        rest = memoryview(line_of(record, self._reader.line + 1, self._reader.run or ""))
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
            if is_due:
                os.fsync(self._file.fileno())
                self._synced = monotonic()
        except BaseException as error:
            with suppress(OSError):
                self._file.truncate(size)
            if isinstance(error, OSError) and error.errno is not None:
                error.filename = str(self._reader.path)
            raise
        self._reader.line += 1

    def close(self) -> None:
        """Force everything to disk."""
        with suppress(OSError):  # the last line of a run was forced to disk when it was written
            os.fsync(self._file.fileno())
        self._file.close()

    def _add(self, record: Record) -> None:
        """Append a record, unless the journal contains it already."""
        if not self._is_recorded(_key(record)):
            self.write(record)

    @property
    def _is_repeating(self) -> bool:
        return any(left and kind != "ended" for (kind, *_), left in self._recorded.items())

    def _is_recorded(self, key: tuple[str | int, ...]) -> bool:
        found = self._recorded[key] > 0
        self._recorded[key] -= found
        return found

    def _evaluated(self, event: Evaluated) -> None:
        """Append an evaluation, and save its trajectory if it is one to keep."""
        if self._is_recorded(("evaluated", event.index)):
            return
        evaluation, file = event.evaluation, None
        is_kept = event.index < _KEPT_TRAJECTORIES or evaluation.seconds > _SLOW
        every = self._keep == "history" and is_kept and self._kept_bytes < _KEPT_BYTES
        # Of any requirement that could be judged.
        trajectory = next((e.trajectory for e in event.judged.values() if e.trajectory is not None), None)
        if trajectory is not None and (event.improved or every):
            file = files.save_trajectory(self.directory, event.index, trajectory)
            self._kept_bytes += (self.directory / file).stat().st_size
        self.write(
            EvaluatedRecord(
                index=event.index,
                status=evaluation.status,
                verdicts={name: e.verdict for name, e in event.judged.items()},
                reason=evaluation.reason,
                seconds=evaluation.seconds,
                log=list(evaluation.log),
                trajectory=file,
                elapsed=event.spent.seconds,
            )
        )
        # Only after the record: a crash in between must not lose the trajectory that the journal refers to.
        if file is not None and self._keep == "best":
            for path in (self.directory / files.TRAJECTORIES).glob("*.npz"):
                if path != self.directory / file:
                    path.unlink()


@contextmanager
def open_journal(directory: Path, *, keep: Keep = "history", patience: float = 0.0) -> Iterator[Journal]:
    """Open the journal of a run directory as its only writer, and close it even after an exception.

    The directory is created if missing. Another process that writes here is given ``patience`` s to end.

    Raises:
        JournalError: if another process still writes here after that time, or a line is damaged.
    """
    files.make_folder(directory)
    files.make_folder(directory / files.TRAJECTORIES)
    with run_lock(directory, patience):
        journal = Journal(directory, keep)
        try:
            yield journal
        finally:
            journal.close()


def run_lock(directory: Path, patience: float = 0.0) -> AbstractContextManager[None]:
    """Hold the lock of a run directory, in which files can then be changed.

    Raises:
        JournalError: if another process writes to it for so many s, or what would be changed is elsewhere.
    """
    for path in (directory / JOURNAL, directory / files.TRAJECTORIES):
        if path.is_symlink():  # whoever made the directory would choose what is changed and deleted
            raise JournalError(
                f"{path} is a link, and a run's files are written and deleted in its own directory only: "
                f"put what it leads to, {one_line(str(path.readlink()))}, in its place"
            )
    busy = f"{directory}: another process is writing to this run; wait until it ends"
    return files.locked(directory / LOCK, busy=busy, patience=patience)


def holds_run(directory: Path) -> bool:
    """Whether a directory contains a run."""
    with files.can_be_a_folder(directory):
        return (directory / manifest.MANIFEST).exists()


def check_new(directory: Path, resume: str = "") -> None:
    """Check that a directory has no campaign, no run and nothing else in it; JournalError if it has.

    ``resume`` is what continues a run there; empty: the usual command or call.
    """
    is_campaign = (directory / files.CAMPAIGN).exists()
    if is_campaign or holds_run(directory):
        what, call = ("campaign", "resume_campaign") if is_campaign else ("run", "resume")
        usual = written(f"falsifier resume {shell_word(directory)}", f"{call}({str(directory)!r})")
        raise JournalError(
            f"{directory} already contains a {what}: choose another directory, or to continue it: "
            + (usual if is_campaign or not resume else resume)
        )
    files.check_unused(directory)


def simulated(directory: Path) -> int:
    """Number of simulations that the journal of a run directory contains."""
    return sum(isinstance(record, EvaluatedRecord) for record in read_journal(directory))


def read_journal(directory: Path) -> list[Record]:
    """Read all complete records of a run directory in order; empty if there is no journal.

    Raises:
        JournalError: if a line is invalid or of another run, unless it is an incomplete last line.
    """
    return list(JournalReader(directory).new())


class JournalReader:
    """Reads a journal that is still growing; the run need not have started."""

    def __init__(self, directory: Path) -> None:
        self.path = directory / JOURNAL
        self.offset = 0
        self.line = 0
        # Numbers of candidates and of evaluations so far, and the requirements that were falsified.
        self._asked = self._evaluated = 0
        self._falsified: set[str] = set()

    @cached_property
    def _described(self) -> manifest.Manifest | None:
        """What the run was started with; None without a manifest, which precedes lines."""
        directory = self.path.parent
        return manifest.read(directory) if holds_run(directory) else None

    @property
    def run(self) -> str | None:
        """Name of the run, which every line repeats; None without a manifest."""
        return None if self._described is None else self._described.run

    @property
    def shrank(self) -> bool:
        """Whether the file is shorter than what was read; then start again with a new reader."""
        return self.path.exists() and self.path.stat().st_size < self.offset

    def new(self) -> Iterator[Record]:
        """Yield the complete records since the last call; JournalError if a line is not one of these."""
        if not self.path.exists() or self.path.stat().st_size == self.offset:
            return
        with self.path.open("rb") as file:
            file.seek(self.offset)
            for line in file:
                if not line.endswith(b"\n"):  # cut off by a crash, or still being written
                    return
                number = self.line + 1
                try:
                    check_seal(line)
                    record = parse_line(line, number, self.run)
                    self._count(record)
                    self._check_names(record)
                except ValueError as error:
                    raise JournalError(
                        f"{self.path}: line {number} is damaged: {error}; to drop what is damaged: "
                        f"falsifier tools repair {shell_word(self.path.parent)}"
                    ) from error
                self.line, self.offset = number, self.offset + len(line)
                yield record

    def _count(self, record: Record) -> None:
        """Count what a record is about; ValueError if what it follows from was not recorded before it."""
        match record:
            case AskedRecord() if record.first == self._asked:
                self._asked += len(record.candidates)
            case EvaluatedRecord() if record.index == self._evaluated < self._asked:
                self._evaluated += 1
            case ConfirmedRecord() if record.index != self._evaluated - 1:
                raise ValueError(f"simulation {record.index}, which it confirms, is not the last before it")
            case AskedRecord() | EvaluatedRecord():
                raise ValueError("the candidates or simulations before those that it is about are missing")

    def _check_names(self, record: Record) -> None:
        """Check what a record names, which others look up; ValueError if the manifest names other things."""
        if (described := self._described) is None:
            return
        names, is_known = set(described.names), True
        match record:
            case AskedRecord():
                searched = [{r.name for r in ranges} for ranges in (described.inputs, described.parameters)]
                is_known = all([{*c.signals}, {*c.parameters}] == searched for c in record.candidates)
            case EvaluatedRecord():
                is_known = names - self._falsified <= record.verdicts.keys() <= names
            case ConfirmedRecord():
                is_known = record.requirement in names
                self._falsified |= {record.requirement} if record.outcome == "confirmed" else set()
        if not is_known:
            raise ValueError("its inputs, parameters or requirements are others than those in manifest.json")


def recorded_candidates(records: Iterable[Record]) -> dict[int, Candidate]:
    """Recorded candidates by the index of their evaluation."""
    return {
        record.first + i: candidate
        for record in records
        if isinstance(record, AskedRecord)
        for i, candidate in enumerate(record.candidates)
    }


def candidates_in(directory: Path) -> dict[int, Candidate]:
    """Read a run's candidates by the index of their evaluation, once for all its requirements."""
    state = (directory / JOURNAL).stat()
    return _candidates_in(directory, (state.st_size, state.st_mtime_ns))


@lru_cache(maxsize=1)
def _candidates_in(directory: Path, state: tuple[int, int]) -> dict[int, Candidate]:
    return recorded_candidates(JournalReader(directory).new())


def recorded_evaluations(records: Sequence[Record], requirement: str) -> dict[int, Evaluation]:
    """Recorded evaluations that were judged on a requirement, by their index, in its order."""
    candidates, ended = recorded_candidates(records), (r for r in records if isinstance(r, EvaluatedRecord))
    judged = (r for r in ended if requirement in r.verdicts)  # not after it was falsified
    return {r.index: r.evaluation(candidates[r.index], requirement) for r in judged}


def _key(record: Record) -> tuple[str | int, ...]:
    """What a record is about: a resumed run does not write a record about the same again."""
    match record:
        case AskedRecord():
            return record.kind, record.first
        case EvaluatedRecord():
            return record.kind, record.index
        case ConfirmedRecord():
            return record.kind, record.index, record.requirement
        case _:
            return (record.kind,)
