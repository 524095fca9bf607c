"""Resumes a run by replay: steps that the journal contains are taken from it, the rest is carried out.

The engine is asked again and must suggest what was recorded; that restores its state. Evaluations,
confirmations and replies of a language model come from the journal and cost nothing. The question without a
valid reply that ended a run is asked again; it stays paid for.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from falsifier.core.candidate import Candidate
from falsifier.engines.protocol import Engine
from falsifier.errors import JournalError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.conversation import MAX_REASKS
from falsifier.llm.messages import Exchange
from falsifier.problem.problem import Problem
from falsifier.record.files import recorded_trajectory
from falsifier.record.records import (
    AskedRecord,
    ConfirmedRecord,
    EndedRecord,
    EvaluatedRecord,
    ExchangeRecord,
    Record,
    elapsed_at,
)
from falsifier.search.budget import USED, Spent
from falsifier.search.steps import Steps, proposals


@dataclass(kw_only=True)
class ReplayedSteps(Steps):
    """The steps that a journal contains, then live ones."""

    asked: dict[int, AskedRecord]  # what engines suggested, by the index of the first candidate's evaluation
    directory: Path  # the run directory
    evaluated: dict[int, EvaluatedRecord]  # recorded evaluations by index
    confirmed: dict[tuple[int, str], ConfirmedRecord]  # by evaluation index and requirement
    _next: int = 0

    def ask(self, problem: Problem, engine: Engine, wanted: int) -> tuple[list[Candidate], int, float]:
        """Let the engine repeat its recorded suggestions; JournalError if it suggests something else."""
        record = self.asked.get(self._next)
        if record is None:
            return super().ask(problem, engine, wanted)
        # The recorded number: near the end of the budget the first run asked for fewer than a full batch.
        candidates = proposals(engine, problem.space, record.n)
        if [c.key for c in candidates] != [c.key for c in record.candidates]:
            raise JournalError(
                f"cannot resume: candidate {record.first} of the engine {engine.name!r} differs from the "
                "journal, which was written with other settings, another version, or an engine that does not "
                "propose the same again, as engines must; start a new run"
            )
        return candidates, record.n, record.seconds

    def start(self, problem: Problem, candidates: Sequence[Candidate]) -> list[Callable[[], Evaluation]]:
        """Return functions for recorded evaluations, and start live ones of candidates without."""
        first, self._next = self._next, self._next + len(candidates)
        return [self._start(problem, *item) for item in enumerate(candidates, first)]

    def _start(self, problem: Problem, index: int, candidate: Candidate) -> Callable[[], Evaluation]:
        """Start what is left of an evaluation: all of it, its trajectory, or nothing."""
        record, start = self.evaluated.get(index), super().start
        if record is None:
            return start(problem, [candidate])[0]
        recorded = record.evaluation(candidate, problem.name)
        # Read only now: those of all evaluations together would fill the memory.
        trajectory = recorded_trajectory(self.directory, record.trajectory)
        if not any(record.verdicts.values()) or trajectory is not None:
            return lambda: replace(recorded, trajectory=trajectory)
        simulate = start(problem, [candidate])[0]

        def repeat() -> Evaluation:
            """Simulate again what was judged but not kept: engines, and other requirements, need it."""
            again = simulate()
            if again.trajectory is None:
                raise JournalError(
                    f"cannot resume: simulation {index + 1}, whose trajectory was not kept, now "
                    f"{again.outcome}; resume again, or start a new run"
                )
            return replace(recorded, trajectory=again.trajectory)

        return repeat

    def confirm(self, problem: Problem, evaluation: Evaluation, index: int) -> Confirmation:
        """Return the recorded confirmation of a violation; without one, confirm it."""
        record = self.confirmed.get((index, problem.name))
        if record is None:
            return super().confirm(problem, evaluation, index)
        return record.confirmation(problem, evaluation)


def replayed(directory: Path, records: Sequence[Record], live: Steps) -> Steps:
    """Return steps that replay a journal; with an empty journal, the live ones."""
    if not records:
        return live
    exchanges, unrepeated = played_back(records)
    evaluated = {r.index: r for r in records if isinstance(r, EvaluatedRecord)}
    confirmed = {(r.index, r.requirement): r for r in records if isinstance(r, ConfirmedRecord)}
    return ReplayedSteps(
        executor=live.executor,
        internals=live.internals,
        replayed=len(evaluated),
        seconds=max(map(elapsed_at, records)),
        unrepeated=unrepeated,
        asked={r.first: r for r in records if isinstance(r, AskedRecord)},
        directory=directory,
        evaluated=evaluated,
        spent={key: record.spent for key, record in confirmed.items()},
        confirmed=confirmed,
        exchanges=iter(exchanges),
    )


def played_back(records: Sequence[Record]) -> tuple[list[Exchange], Spent]:
    """The exchanges that a resumed run plays back, and what the others had cost when the run ended.

    A question to which no reply was valid, at which the run failed, is asked again: its recorded replies
    would only fail once more. One that was cut off, whatever by, goes on after its last reply.
    """
    kept: list[Exchange] = []
    unrepeated, answered = Spent(), 0
    for record in records:
        if isinstance(record, ExchangeRecord):
            kept.append(record.exchange)
        elif isinstance(record, AskedRecord):
            answered = len(kept)
        elif isinstance(record, EndedRecord):
            rejected = sum(bool(e.problem) and e.reply is not None for e in kept[answered:])
            if record.status == "failed" and rejected > MAX_REASKS:
                del kept[answered:]
            unrepeated = _difference(record.spent, kept)
    return kept, unrepeated


def _difference(spent: Spent, played: Sequence[Exchange]) -> Spent:
    """What was spent on a language model beyond the exchanges that are played back."""
    again = sum((Spent.on_requests(each.requests, each.usage) for each in played), Spent())
    return Spent(
        cost=None if spent.cost is None else max(0.0, round(spent.cost - (again.cost or 0.0), 12)),
        **{name: getattr(spent, name) - getattr(again, name) for name in ("calls", *USED)},
    )
