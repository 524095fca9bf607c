"""Makes a damaged run directory readable again: what is damaged is dropped, and repeated by ``resume``.

Before a file is changed, a copy is kept beside it. Simulations and confirmations are repeated with the same
result. Replies of a language model are not: everything from the first damaged exchange on is dropped.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from shutil import copy2

from filelock import FileLock, Timeout

from falsifier.core.files import write_whole
from falsifier.core.words import counted
from falsifier.errors import JournalError
from falsifier.record import manifest
from falsifier.record.journal import JOURNAL, LOCK, TRAJECTORIES, is_intact
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

# What a line that cannot be read was about, judged by its beginning.
_REPEATABLE = (b'"kind":"asked"', b'"kind":"evaluated"', b'"kind":"confirmed"', b'"kind":"ended"')
_KIND_WITHIN = 40


@dataclass(frozen=True, slots=True)
class _Damage:
    """A place in a journal where lines are missing or cannot be read.

    Attributes:
        number: number of the first line that is affected.
        repeatable: whether only steps are affected that ``resume`` repeats with the same result.
    """

    number: int
    repeatable: bool


def repair(directory: Path) -> list[str]:
    """Drop what is damaged in a run directory; return what was found, in words; empty if nothing was.

    Raises:
        JournalError: if the manifest is damaged, which nothing can replace, or a process writes here.
    """
    asks_llm = manifest.read(directory).request.llm is not None
    lock = FileLock(directory / LOCK)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise JournalError(
            f"{directory}: another process is writing to this run; wait until it ends"
        ) from None
    try:
        journal = _repair_journal(directory / JOURNAL, asks_llm=asks_llm)
        return [*journal, *_repair_trajectories(directory / TRAJECTORIES)]
    finally:
        lock.release()


def set_aside(path: Path) -> Path:
    """Rename a damaged file or folder, so that it is kept but no longer read; return its new path."""
    return path.rename(_free(path))


def _free(path: Path) -> Path:
    names = (path.with_name(f"{path.name}.damaged-{i}") for i in range(1, 10_000))
    return next(name for name in names if not name.exists())


def _repair_trajectories(folder: Path) -> list[str]:
    damaged = [path for path in sorted(folder.glob("*.npz")) if not is_intact(path, path.read_bytes())]
    return [f"{path}: damaged; kept as {set_aside(path).name}, simulated again if needed" for path in damaged]


def _repair_journal(path: Path, *, asks_llm: bool) -> list[str]:
    if path.is_dir():
        return [f"{path}: a folder, not a journal; kept as {set_aside(path).name}"]
    content = path.read_bytes() if path.exists() else b""
    content = content[: content.rfind(b"\n") + 1]  # a crash may have cut off the last line
    found: dict[int, Record] = {}
    findings: list[str] = []
    damages: list[_Damage] = []
    for number, line in enumerate(content.splitlines(keepends=True), 1):
        try:
            record = parse_line(line)
        except ValueError as error:
            findings.append(f"{path}: line {number}: {error}")
            repeatable = any(kind in line[:_KIND_WITHIN] for kind in _REPEATABLE)
            damages.append(_Damage(max(found, default=0) + 1, repeatable))
            continue
        if record.line in found:
            findings.append(f"{path}: line {number}: line {record.line} is doubled")
        found.setdefault(record.line, record)
    gaps = _gaps(sorted(found), damages)
    findings += [f"{path}: line {gap.number} is missing" for gap in gaps]
    kept = _consistent([found[number] for number in sorted(found)], [*damages, *gaps], asks_llm=asks_llm)
    repaired = b"".join(line_of(record, number) for number, record in enumerate(kept, 1))
    if repaired == content:
        return []
    copy = copy2(path, _free(path))
    write_whole(path, repaired)
    lost = len(content.splitlines()) - len(kept)
    again = f"{counted(lost, 'line')} dropped, the original is kept as {Path(copy).name}"
    return [*findings, f"{path}: {again}; falsifier resume repeats what is missing"]


def _gaps(numbers: Sequence[int], known: Iterable[_Damage]) -> list[_Damage]:
    """Places where more lines are missing than could not be read."""
    unread: dict[int, int] = {}
    for damage in known:
        unread[damage.number] = unread.get(damage.number, 0) + 1
    pairs = zip([0, *numbers], numbers, strict=False)
    return [
        _Damage(last + 1, repeatable=False)
        for last, following in pairs
        if following - last - 1 > unread.get(last + 1, 0)
    ]


def _consistent(records: Sequence[Record], damages: Sequence[_Damage], *, asks_llm: bool) -> list[Record]:
    """Records that can be replayed: evaluations with their candidate, confirmations with their evaluation."""
    if asks_llm:
        first = min((d.number for d in damages if not d.repeatable), default=None)
        records = [record for record in records if first is None or record.line < first]
    if not damages:
        return list(records)
    candidates: set[int] = set()
    evaluated: set[int] = set()
    kept: list[Record] = []
    for record in records:
        match record:
            case AskedRecord():
                candidates |= set(range(record.first, record.first + len(record.candidates)))
            case EvaluatedRecord():
                if record.index not in candidates:
                    continue
                evaluated.add(record.index)
            case ConfirmedRecord():
                if record.index not in evaluated:
                    continue
            case EndedRecord():
                continue
            case ExchangeRecord():
                pass
        kept.append(record)
    return kept
