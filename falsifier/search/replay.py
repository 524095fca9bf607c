"""Resumes a run by replay: steps that the journal contains are taken from it, the rest is carried out.

The engine is asked again and must suggest what was recorded; that restores its state. Evaluations,
confirmations and replies of a language model come from the journal and cost nothing.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path

from falsifier.core.candidate import Candidate
from falsifier.engines.protocol import Engine
from falsifier.errors import JournalError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.messages import Chat
from falsifier.llm.replay import RecordedChat, Recording
from falsifier.problem.problem import Problem
from falsifier.search.journal import recorded_evaluations, recorded_exchanges
from falsifier.search.proposals import proposals
from falsifier.search.records import AskedRecord, ConfirmedRecord, EndedRecord, Record
from falsifier.search.steps import Steps


@dataclass(slots=True)
class Replayed:
    """The steps that a journal contains, then live ones.

    Attributes:
        live: carries out the rest.
        asked: what engines suggested, in order, by the index of the first candidate's evaluation.
        evaluations: recorded evaluations by index; those that a repair dropped are carried out.
        confirmed: recorded confirmations by evaluation index and requirement.
        recording: recorded replies of a language model.
        seconds: wall-clock seconds of the recorded part.
    """

    live: Steps
    asked: dict[int, list[AskedRecord]]
    evaluations: dict[int, Evaluation]
    confirmed: dict[tuple[int, str], ConfirmedRecord]
    recording: Recording
    seconds: float
    replayed: int = field(init=False)
    _next: int = 0

    def __post_init__(self) -> None:
        self.replayed = len(self.evaluations)

    def ask(self, problem: Problem, engine: Engine, wanted: int) -> tuple[list[Candidate], int, float]:
        """Let the engine repeat its recorded suggestions.

        Raises:
            JournalError: if it suggests something else.
        """
        if not self.asked.get(self._next):
            return self.live.ask(problem, engine, wanted)
        record = self.asked[self._next].pop(0)
        # The recorded number: near the end of the budget the first run asked for fewer than a full batch.
        candidates = proposals(engine, problem.space, record.n)
        if [c.key for c in candidates] != [Candidate.from_json(c).key for c in record.candidates]:
            raise JournalError(
                f"cannot resume: candidate {record.first} of the engine {engine.name!r} differs from the "
                "journal, which was written with other settings or another version; start a new run"
            )
        return candidates, record.n, record.seconds

    def evaluate(self, problem: Problem, candidates: Sequence[Candidate]) -> Iterator[Evaluation]:
        """Yield recorded evaluations, and live ones of candidates without."""
        numbered = list(enumerate(candidates, self._next))
        self._next += len(candidates)
        for is_recorded, group in groupby(numbered, lambda pair: pair[0] in self.evaluations):
            if is_recorded:
                yield from (_with_trajectory(problem, self.evaluations[index]) for index, _ in group)
            else:
                yield from self.live.evaluate(problem, [candidate for _, candidate in group])

    def confirm(self, problem: Problem, evaluation: Evaluation, index: int) -> Confirmation:
        """Return the recorded confirmation of a violation; without one, confirm it."""
        record = self.confirmed.get((index, problem.name))
        if record is None:
            return self.live.confirm(problem, evaluation, index)
        return Confirmation(
            problem=problem,
            evaluation=evaluation,
            outcome=record.outcome,
            robustness=record.robustness,
            reference=record.reference,
            reason=record.reason,
            halved=record.halved,
        )

    def chat(self, inner: Chat) -> Chat:
        """Return a chat that plays the recorded replies first."""
        return RecordedChat(self.recording, self.live.chat(inner))


def replayed(directory: Path, records: Sequence[Record], live: Steps) -> Steps:
    """Return steps that replay a journal; with an empty journal, the live ones."""
    if not records:
        return live
    asked: dict[int, list[AskedRecord]] = {}
    for record in records:
        if isinstance(record, AskedRecord):
            asked.setdefault(record.first, []).append(record)
    ended = [r.spent["seconds"] or 0.0 for r in records if isinstance(r, ConfirmedRecord | EndedRecord)]
    return Replayed(
        live,
        asked,
        recorded_evaluations(directory, records),
        {(r.index, r.requirement): r for r in records if isinstance(r, ConfirmedRecord)},
        Recording(recorded_exchanges(records)),
        max(ended, default=0.0),
    )


def _with_trajectory(problem: Problem, evaluation: Evaluation) -> Evaluation:
    """Simulate a recorded evaluation again if its trajectory was not kept, because engines need it."""
    if evaluation.verdict is None or evaluation.trajectory is not None:
        return evaluation
    return replace(evaluation, trajectory=evaluate(problem, evaluation.candidate).trajectory)
