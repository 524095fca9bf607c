"""One requirement's part of a search in which several were falsified together."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path

from falsifier.core.trajectory import Trajectory
from falsifier.errors import FalsifierError
from falsifier.search.journal import (
    AskedRecord,
    ConfirmedRecord,
    EndedRecord,
    EvaluatedRecord,
    Record,
    VerdictRecord,
    read_journal,
)
from falsifier.search.tally import Tally
from falsifier.stl import Formula, Monitor, parse


def shared_tally(directory: Path, requirement: Mapping[str, str]) -> Tally:
    """Numbers of one requirement; they stop where it fell, as if its run had ended there.

    Args:
        directory: of the run.
        requirement: name and formula, as its manifest says them.

    Raises:
        JournalError: when a line other than a torn last one cannot be understood.
    """
    formula, tally = parse(requirement["formula"]), Tally()
    for record in _own(directory, read_journal(directory), requirement["name"], formula):
        tally.add(record)
        if isinstance(record, ConfirmedRecord) and record.outcome == "confirmed":
            # Old journals do not say what was used by now: at least the time of the simulations.
            spent = record.spent or asdict(tally.spent) | {"seconds": tally.spent.simulation_seconds}
            tally.add(EndedRecord(status="falsified", reason=record.reason, spent=spent))
            break
    return tally


def _own(directory: Path, records: Iterable[Record], name: str, formula: Formula) -> Iterator[Record]:
    """Yield the records as they would be if this requirement had judged all simulations."""
    turn = ""
    for record in records:
        match record:
            case AskedRecord():
                turn = record.requirement
                yield record
            case EvaluatedRecord(verdicts=None) if turn != name:
                yield record.model_copy(update={"verdict": _judged(directory, record, formula)})
            case EvaluatedRecord():
                verdict = record.verdict if record.verdicts is None else record.verdicts.get(name)
                yield record.model_copy(update={"verdict": verdict})
            case ConfirmedRecord() if record.requirement != name:
                pass
            case _:
                yield record


def _judged(directory: Path, record: EvaluatedRecord, formula: Formula) -> VerdictRecord | None:
    """Judge what was simulated in another's turn, where no verdict but that one's was recorded.

    None where the trajectory was not kept.
    """
    path = directory / (record.trajectory or "-")
    if record.verdict is None or not path.is_file():
        return None
    trajectory = Trajectory.load(path)
    times = trajectory.times
    step = float(times[-1]) / (len(times) - 1)
    try:
        verdict = Monitor(formula, step=step, samples=len(times)).evaluate(trajectory)
    except FalsifierError:
        return None
    return VerdictRecord.of(verdict)
