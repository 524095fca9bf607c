"""What a recorded run asked a language model, what came of it, and which of its violations are in doubt."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from falsifier.core.candidate import Candidate
from falsifier.core.words import counted
from falsifier.errors import JournalError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.messages import Exchange
from falsifier.problem.problem import Problem
from falsifier.record.records import AskedRecord, ConfirmedRecord, EvaluatedRecord, ExchangeRecord, Record
from falsifier.stl.margins import signed


@dataclass(frozen=True, slots=True)
class Sample:
    """What came of one candidate."""

    index: int  # index of its evaluation
    candidate: Candidate  # what was proposed
    # Robustness, or why there is none, and whether a violation was confirmed; empty if it was not simulated.
    text: str


@dataclass(frozen=True, slots=True)
class Iteration:
    """One call of an engine, and what came of it: what was asked and answered, and a sample per candidate."""

    exchanges: tuple[Exchange, ...]
    samples: tuple[Sample, ...]


def iterations(records: Iterable[Record], requirement: str) -> list[Iteration]:
    """Return the calls of the engine of one requirement in order.

    Exchanges after the last call are a call of their own, without candidates: the run ended during it.
    """
    told, asked = _results(records := list(records), requirement), list[Exchange]()
    found = []
    for record in records:
        if isinstance(record, ExchangeRecord):
            asked.append(record.exchange)
        elif isinstance(record, AskedRecord):
            if record.requirement == requirement:
                samples = [
                    Sample(i, c, told.get(i, "")) for i, c in enumerate(record.candidates, start=record.first)
                ]
                found.append(Iteration(tuple(asked), tuple(samples)))
            asked = []
    return [*found, Iteration(tuple(asked), ())] if asked else found


def _results(records: Iterable[Record], requirement: str) -> dict[int, str]:
    """Return what came of each evaluation, by index."""
    found: dict[int, str] = {}
    for record in records:
        if isinstance(record, EvaluatedRecord):
            verdict = record.verdicts.get(requirement)
            judged = f"robustness {signed(verdict.robustness)}" if verdict else ""
            found[record.index] = judged or f"{record.status}: {record.reason}"
        elif isinstance(record, ConfirmedRecord) and record.requirement == requirement:
            reason = "" if record.outcome == "confirmed" else f" ({record.reason})"
            found[record.index] += f", {record.outcome}{reason}"
    return found


def exchange_before(records: Iterable[Record], index: int) -> Exchange | None:
    """Return the last exchange before an evaluation, or None; JournalError if there is no such evaluation."""
    last: Exchange | None = None
    count = 0
    for record in records:
        if isinstance(record, ExchangeRecord):
            last = record.exchange
        elif isinstance(record, AskedRecord):
            if 0 <= index - record.first < len(record.candidates):
                return last
            count = record.first + len(record.candidates)
    raise JournalError(f"the run has no sample {index + 1}: it has {counted(count, 'sample')}")


def doubtful_confirmations(
    problem: Problem, records: Iterable[Record], evaluations: Mapping[int, Evaluation]
) -> list[Confirmation]:
    """Return the recorded confirmations of violations that do not count, of one requirement."""
    return [
        record.confirmation(problem, evaluations[record.index])
        for record in records
        if isinstance(record, ConfirmedRecord)
        and record.requirement == problem.name
        and record.outcome != "confirmed"
        and record.index in evaluations
    ]
