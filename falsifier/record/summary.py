"""A run's journal in numbers, updated record by record as it grows."""

from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from math import isnan
from pathlib import Path
from typing import Generic, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from falsifier.record import records
from falsifier.record.journal import JournalReader
from falsifier.search.budget import Spent
from falsifier.search.findings import Failure, Finding, failures
from falsifier.search.result import ResultStatus, mostly_unjudged
from falsifier.stl.monitor import Verdict

RunStatus = ResultStatus | Literal["waiting", "running"]


@dataclass(kw_only=True)
class Summary:
    """Numbers of one requirement in one run, updated by adding records in order.

    They stop at the requirement's counterexample: a shared search continues for the other requirements.
    """

    recorded_as: str | None = None  # name of the requirement in the journal; None: the run has only one
    status: RunStatus = "waiting"  # before the first record; ``running`` until the run has ended
    reason: str = ""  # why it ended, in words
    best: int | None = None  # index of the evaluation with the smallest robustness
    verdict: Verdict | None = None  # of the counterexample; without one, of the best evaluation
    counterexample: int | None = None  # index of the confirmed violation
    # Outcome and reason of violations that were not confirmed, and file names of kept trajectories, by index.
    unconfirmed: dict[int, str] = field(default_factory=dict)
    trajectories: dict[int, str] = field(default_factory=dict)
    spent: Spent = field(default_factory=Spent)  # by the run
    findings: tuple[Finding, ...] = ()  # what the search could not show; empty before it has ended
    _robustness: list[float] = field(default_factory=list)
    _failed: dict[int, str] = field(default_factory=dict)
    _latest: Verdict | None = None

    @property
    def falsified(self) -> bool:
        """Whether a confirmed counterexample was found."""
        return self.status == "falsified"

    @property
    def finished(self) -> bool:
        """Whether it ended with a result: falsified, or at a limit, or with nothing left to try."""
        return self.status in ("falsified", "not falsified")

    @property
    def unjudged(self) -> str:
        """That it could not be judged in most simulations, in words; empty if it could."""
        return mostly_unjudged([None if isnan(r) else r for r in self._robustness])

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
        """Robustness of the counterexample; otherwise the smallest so far that is no violation.

        A violation that is not confirmed, or not yet, is no result.
        """
        if self.counterexample is not None:
            return self._robustness[self.counterexample]
        return min((known for known in self._robustness if known >= 0), default=None)

    @property
    def shown(self) -> int | None:
        """Index of the evaluation to show: the counterexample, otherwise the best one; None without any."""
        return self.best if self.counterexample is None else self.counterexample

    def add(self, record: records.Record) -> None:
        """Update the numbers with one record."""
        if self.counterexample is not None:
            return
        self.status, self.reason, self.findings = "running", "", ()  # not those before it was resumed
        self.spent = replace(self.spent, seconds=records.elapsed_at(record))
        match record:
            case records.EvaluatedRecord():
                self._evaluated(record)
            case records.ConfirmedRecord() if self.recorded_as not in (None, record.requirement):
                pass
            case records.ConfirmedRecord(outcome="confirmed"):
                self.counterexample = record.index
                self.verdict = self._latest
                self.status, self.reason = "falsified", record.reason
                self.spent = record.spent
            case records.ConfirmedRecord():
                self.unconfirmed[record.index] = f"{record.outcome}: {record.reason}"
            case records.ExchangeRecord():
                exchange = record.exchange
                self.spent += Spent.on_requests(exchange.requests, exchange.usage)
            case records.EndedRecord():
                self.status, self.reason, self.spent = record.status, record.reason, record.spent
                if record.status == "not falsified" and self.unjudged:  # as in the result
                    self.status, self.reason = "failed", self.unjudged
                own = [found for name, found in record.findings.items() if self.recorded_as in (None, name)]
                self.findings = tuple(each for found in own for each in found)

    def _evaluated(self, record: records.EvaluatedRecord) -> None:
        judged = record.verdicts
        name = next(iter(judged)) if self.recorded_as is None else self.recorded_as
        verdict = judged[name]
        self._latest = verdict
        if verdict is not None and (self.best is None or verdict.robustness < self._robustness[self.best]):
            self.best, self.verdict = record.index, verdict
        if record.trajectory is not None:
            self.trajectories[record.index] = record.trajectory
        self._robustness.append(verdict.robustness if verdict else float("nan"))
        failed = all(v is None for v in judged.values())
        if failed:
            self._failed[record.index] = record.reason
        self.spent += Spent(simulations=1, simulation_seconds=record.seconds, failed=int(failed))


S = TypeVar("S", bound=Summary)


class RunFollower(Generic[S]):
    """Follows the journal of a run that may still be going on, and need not have started.

    Its summaries, one per requirement of interest, say what was read so far; ``empty`` are those before.
    """

    def __init__(self, directory: Path, empty: Sequence[S]) -> None:
        self.directory = directory
        self._empty = empty
        self._begin()

    def _begin(self) -> None:
        self.summaries = deepcopy(list(self._empty))
        self._reader = JournalReader(self.directory)

    def read(self) -> Iterator[records.Record]:
        """Yield the records that are new, after they were added to the summaries.

        Raises:
            JournalError: if a line is invalid, unless it is an incomplete last line.
        """
        if self._reader.shrank:  # the run was repaired, or the directory replaced
            self._begin()
        for record in self._reader.new():
            for summary in self.summaries:
                summary.add(record)
            yield record

    def look(self) -> list[S]:
        """Read all that is new, and return the summaries."""
        for _ in self.read():
            pass
        return self.summaries
