"""A run's journal in numbers, updated record by record as it grows."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from falsifier.llm.messages import Exchange
from falsifier.record.journal import JournalReader
from falsifier.record.records import (
    AskedRecord,
    ConfirmedRecord,
    EndedRecord,
    EvaluatedRecord,
    ExchangeRecord,
    Record,
    elapsed_at,
)
from falsifier.search.budget import Spent
from falsifier.search.findings import Failure, Finding, failures
from falsifier.search.result import ResultStatus
from falsifier.stl.monitor import Verdict

RunStatus = ResultStatus | Literal["waiting", "running"]
FINISHED: tuple[RunStatus, ...] = ("falsified", "not falsified")


class Summary:
    """Numbers of one requirement in one run, updated by adding records in order.

    They stop at the requirement's counterexample: a shared search continues for the other requirements.

    Args:
        requirement: name of the requirement; None: the run has only one.

    Attributes:
        status: ``waiting`` before the first record; ``running`` until the run has ended.
        reason: why it ended, in words.
        best: index of the evaluation with the smallest robustness, or None.
        verdict: verdict of the counterexample; without one, of the best evaluation.
        counterexample: index of the confirmed violation, or None.
        unconfirmed: outcome and reason of violations that were not confirmed, by index.
        trajectories: file names of kept trajectories, by index.
        findings: what the search could not show; empty before it has ended.
    """

    def __init__(self, requirement: str | None = None) -> None:
        self.status: RunStatus = "waiting"
        self.reason = ""
        self.best: int | None = None
        self.verdict: Verdict | None = None
        self.counterexample: int | None = None
        self.unconfirmed: dict[int, str] = {}
        self.trajectories: dict[int, str] = {}
        self.findings: tuple[Finding, ...] = ()
        self._requirement = requirement
        self._spent = Spent()
        self._simulation_seconds = 0.0
        self._failed: dict[int, str] = {}
        self._robustness: list[float] = []
        self._latest: Verdict | None = None

    @property
    def spent(self) -> Spent:
        """What the run has spent."""
        return replace(
            self._spent,
            simulations=len(self._robustness),
            simulation_seconds=self._simulation_seconds,
            failures=len(self._failed),
        )

    @property
    def failures(self) -> tuple[Failure, ...]:
        """Why simulations failed, by cause."""
        return failures(sorted(self._failed.items()))

    @property
    def robustness(self) -> NDArray[np.float64]:
        """Robustness of each evaluation, shape (n,); NaN without a verdict."""
        return np.array(self._robustness, dtype=np.float64)

    @property
    def best_robustness(self) -> float | None:
        """Smallest robustness so far."""
        return None if self.best is None else self._robustness[self.best]

    def begin(self) -> None:
        """Set the status to running even if the first record was skipped by the reader."""
        if self.status == "waiting":
            self.status = "running"

    def add(self, record: Record) -> None:
        """Update the numbers with one record."""
        if self.counterexample is not None:
            return
        self.status = "running"
        self._spent = replace(self._spent, seconds=elapsed_at(record))
        match record:
            case EvaluatedRecord():
                self._evaluated(record)
            case ConfirmedRecord() if self._requirement not in (None, record.requirement):
                pass
            case ConfirmedRecord(outcome="confirmed"):
                self.counterexample = record.index
                self.verdict = self._latest
                self.status, self.reason = "falsified", record.reason
                self._spent = record.spent
            case ConfirmedRecord():
                self.unconfirmed[record.index] = f"{record.outcome}: {record.reason}"
            case ExchangeRecord():
                exchange = Exchange.model_validate(record.exchange)
                self._spent = self._spent.plus_requests(exchange.requests, exchange.usage)
            case EndedRecord():
                self.status = record.status
                self.reason = record.reason
                self._spent = record.spent
                own = [found for name, found in record.findings.items() if self._requirement in (None, name)]
                self.findings = tuple(each for found in own for each in found)
            case AskedRecord():
                pass

    def _evaluated(self, record: EvaluatedRecord) -> None:
        judged = record.verdicts
        verdict = (
            next(iter(judged.values()), None) if self._requirement is None else judged[self._requirement]
        )
        self._latest = verdict
        smallest = self.best_robustness
        if verdict is not None and (smallest is None or verdict.robustness < smallest):
            self.best, self.verdict = record.index, verdict
        if record.trajectory is not None:
            self.trajectories[record.index] = record.trajectory
        self._robustness.append(verdict.robustness if verdict else float("nan"))
        self._simulation_seconds += record.seconds
        if all(v is None for v in judged.values()):
            self._failed[record.index] = record.reason


def read_summary(directory: Path, requirement: str | None = None) -> Summary:
    """Read the numbers of a run directory's complete journal; see Summary.

    Raises:
        JournalError: if a line is invalid, unless it is an incomplete last line.
    """
    summary, reader = Summary(requirement), JournalReader(directory, with_candidates=False)
    for record in reader.new():
        summary.add(record)
    if reader.begun:
        summary.begin()
    return summary
