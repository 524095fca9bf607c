"""What a run's journal says in numbers, line by line, as it grows."""

import json
import re
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from falsifier.errors import JournalError
from falsifier.llm.messages import Exchange
from falsifier.search.budget import Spent
from falsifier.search.journal import (
    RECORDS,
    AskedRecord,
    ConfirmedRecord,
    EndedRecord,
    EvaluatedRecord,
    ExchangeRecord,
    Record,
)

RunStatus = Literal["waiting", "running", "falsified", "not falsified", "interrupted", "failed"]
FINISHED: tuple[RunStatus, ...] = ("falsified", "not falsified")

# Candidates are long and say nothing that is counted here.
_ASKED = b'{"kind":"asked"'
_FIRST = re.compile(rb'\{"kind":"asked","first":(\d+),')


class Tally:
    """Numbers of one run, kept up to date by feeding it journal lines in order.

    Attributes:
        status: ``waiting`` before the first line; ``running`` until the run has ended.
        reason: why it ended, in words.
        robustness: of each evaluation in order; NaN where the simulation gave none.
        best: index of the smallest robustness, or None.
        verdict: what the journal says of the counterexample's verdict; without one, of the best evaluation's.
        counterexample: index of the confirmed violation, or None.
        unconfirmed: what was said of violations that were not confirmed.
        trajectories: file names of kept trajectories by evaluation.
    """

    def __init__(self) -> None:
        self.status: RunStatus = "waiting"
        self.reason = ""
        self.best: int | None = None
        self.verdict: dict[str, Any] | None = None
        self.counterexample: int | None = None
        self.unconfirmed: dict[int, str] = {}
        self.trajectories: dict[int, str] = {}
        self._spent = Spent()
        self._simulation_seconds = 0.0
        self._robustness: list[float] = []
        self._latest: dict[str, Any] | None = None

    @property
    def spent(self) -> Spent:
        """What the run has used; wall-clock seconds are known once it has ended."""
        return replace(
            self._spent, simulations=len(self._robustness), simulation_seconds=self._simulation_seconds
        )

    @property
    def robustness(self) -> NDArray[np.float64]:
        """Robustness of each evaluation, shape (n,)."""
        return np.array(self._robustness, dtype=np.float64)

    @property
    def best_robustness(self) -> float | None:
        """Smallest robustness so far."""
        return None if self.best is None else self._robustness[self.best]

    def feed(self, line: bytes, where: str) -> None:
        """Take in one complete line; where names it in errors.

        Raises:
            JournalError: when the line cannot be understood.
        """
        if line.startswith(_ASKED):
            self.status = "running"
            return
        try:
            self.add(RECORDS.validate_json(line))
        except ValidationError as error:
            raise JournalError(f"{where} is damaged: {error.errors()[0]['msg']}") from None

    def add(self, record: Record) -> None:
        """Take in one record."""
        self.status = "running"
        match record:
            case EvaluatedRecord():
                self._evaluated(record)
            case ConfirmedRecord(outcome="confirmed"):
                self.counterexample = record.index
                self.verdict = self._latest
            case ConfirmedRecord():
                self.unconfirmed[record.index] = f"{record.outcome}: {record.reason}"
            case ExchangeRecord():
                usage = Exchange.model_validate(record.exchange).usage
                self._spent = self._spent.plus_call(
                    prompt=usage.prompt_tokens,
                    completion=usage.completion_tokens,
                    reasoning=usage.reasoning_tokens,
                    cost=usage.cost,
                )
            case EndedRecord():
                self.status = _ended(record.status)
                self.reason = record.reason
                self._spent = _spent(record.spent)
            case AskedRecord():
                pass

    def _evaluated(self, record: EvaluatedRecord) -> None:
        value = record.verdict.robustness if record.verdict else float("nan")
        smallest = self.best_robustness
        self._latest = record.verdict.model_dump() if record.verdict else None
        if record.verdict is not None and (smallest is None or value < smallest):
            self.best = record.index
            self.verdict = self.verdict if self.counterexample is not None else self._latest
        if record.trajectory is not None:
            self.trajectories[record.index] = record.trajectory
        self._robustness.append(value)
        self._simulation_seconds += record.seconds


def read_tally(directory: Path) -> Tally:
    """Numbers of a run directory's whole journal.

    Raises:
        JournalError: when a line other than a torn last one cannot be understood.
    """
    tally = Tally()
    path = directory / "journal.jsonl"
    lines = path.read_bytes().split(b"\n") if path.exists() else [b""]
    for number, line in enumerate(lines[:-1], start=1):  # what follows the last newline is torn or empty
        tally.feed(line, f"{path}: line {number}")
    return tally


def read_candidate(directory: Path, index: int) -> dict[str, Any]:
    """Candidate of an evaluation in its plain form, from the journal of a run directory.

    Raises:
        JournalError: when the journal holds no such candidate.
    """
    last: tuple[int, bytes] | None = None
    for line in (directory / "journal.jsonl").read_bytes().split(b"\n")[:-1]:
        asked = _FIRST.match(line)
        if asked is not None and int(asked[1]) <= index:
            last = int(asked[1]), line
    if last is not None:
        candidates: list[dict[str, Any]] = json.loads(last[1])["candidates"]
        if index - last[0] < len(candidates):
            return candidates[index - last[0]]
    raise JournalError(f"{directory}: the journal holds no candidate {index}")


def _spent(recorded: dict[str, float | None]) -> Spent:
    """Spent from its record, in which all numbers are floats."""
    whole = {f.name for f in fields(Spent) if f.type is int}
    numbers = {name: int(v) if name in whole and v is not None else v for name, v in recorded.items()}
    return Spent(**numbers)  # type: ignore[arg-type]


def _ended(status: str) -> RunStatus:
    known: dict[str, RunStatus] = {"falsified": "falsified", "not falsified": "not falsified"}
    known["interrupted"] = "interrupted"
    return known.get(status, "failed")
