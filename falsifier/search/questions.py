"""What a recorded run asked a language model, and which of its violations are in doubt."""

from collections.abc import Iterable, Mapping

from falsifier.errors import JournalError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.messages import Exchange
from falsifier.problem.problem import Problem
from falsifier.search.records import AskedRecord, ConfirmedRecord, ExchangeRecord, Record


def exchange_before(records: Iterable[Record], index: int) -> Exchange | None:
    """Return the last exchange before an evaluation's candidate was suggested; None if there was none.

    Raises:
        JournalError: if the journal contains no such evaluation.
    """
    last: ExchangeRecord | None = None
    for record in records:
        if isinstance(record, ExchangeRecord):
            last = record
        elif isinstance(record, AskedRecord) and 0 <= index - record.first < len(record.candidates):
            return None if last is None else Exchange.model_validate(last.exchange)
    raise JournalError(f"the run has no sample {index + 1}")


def doubtful_confirmations(
    problem: Problem, records: Iterable[Record], evaluations: Mapping[int, Evaluation]
) -> list[Confirmation]:
    """Return the recorded confirmations of violations that do not count, of one requirement.

    Args:
        problem: problem whose requirement was violated.
        records: records of a journal.
        evaluations: evaluations of the same run by their index.
    """
    return [
        Confirmation(
            problem=problem,
            evaluation=evaluations[record.index],
            outcome=record.outcome,
            robustness=record.robustness,
            reference=record.reference,
            reason=record.reason,
            halved=record.halved,
        )
        for record in records
        if isinstance(record, ConfirmedRecord)
        and record.requirement == problem.name
        and record.outcome != "confirmed"
        and record.index in evaluations
    ]
