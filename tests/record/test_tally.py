from falsifier.evaluation.confirm import Outcome
from falsifier.llm.messages import ChatReply, Exchange, Message, Usage
from falsifier.record.records import (
    AskedRecord,
    ConfirmedRecord,
    EndedRecord,
    EvaluatedRecord,
    ExchangeRecord,
    VerdictRecord,
)
from falsifier.record.tally import Tally


def status(tally: Tally) -> str:
    """Read the status anew: the type checker takes an attribute that was compared once for settled."""
    return tally.status


def evaluated(index: int, robustness: float | None) -> EvaluatedRecord:
    verdict = None
    if robustness is not None:
        verdict = VerdictRecord(
            robustness=robustness, critical_time=1.0, predicate="x <= 1", values={"x": 2.0}
        )
    status = "ok" if verdict else "failed"
    return EvaluatedRecord(
        index=index, status=status, verdicts={"R": verdict}, seconds=0.5, elapsed=index + 1
    )


def confirmed(index: int, outcome: Outcome, reason: str, **spent: float | None) -> ConfirmedRecord:
    return ConfirmedRecord(
        index=index,
        requirement="R",
        outcome=outcome,
        robustness=-1.0,
        reference=-1.0,
        reason=reason,
        spent=spent,
    )


def test_a_growing_journal_is_counted_line_by_line() -> None:
    tally = Tally()
    assert status(tally) == "waiting"
    tally.add(AskedRecord(first=0, n=1, candidates=[], seconds=0.1, requirement="R", told=0, elapsed=0.1))
    assert status(tally) == "running"
    for i, robustness in enumerate([2.0, None, 1.0, 1.0, -3.0]):
        tally.add(evaluated(i, robustness))
    assert (tally.best, tally.best_robustness) == (4, -3.0)
    assert (tally.spent.simulations, tally.spent.simulation_seconds, tally.spent.seconds) == (5, 2.5, 5.0)
    tally.add(confirmed(2, "fragile", "vanishes"))
    assert status(tally) == "running"
    tally.add(confirmed(4, "confirmed", "yes", simulations=5.0, seconds=9.0, cost=None))
    assert tally.counterexample == 4
    assert tally.unconfirmed == {2: "fragile: vanishes"}
    assert (tally.status, tally.spent.seconds, tally.spent.cost) == ("falsified", 9.0, None)


def test_what_others_do_after_a_requirement_was_falsified_is_not_its_own() -> None:
    tally = Tally("R")
    tally.add(evaluated(0, -1.0))
    tally.add(confirmed(0, "confirmed", "yes", simulations=1.0))
    other = evaluated(1, 5.0).model_copy(update={"verdicts": {"S": None}})
    tally.add(other)
    tally.add(EndedRecord(status="not falsified", reason="S stands", spent={"simulations": 2.0}))
    assert (status(tally), tally.reason, tally.spent.simulations) == ("falsified", "yes", 1)


def test_tokens_and_money_of_a_running_run_come_from_its_exchanges() -> None:
    tally = Tally()
    usage = Usage(prompt_tokens=100, completion_tokens=20, reasoning_tokens=5, cost=0.25)
    exchange = Exchange(
        llm="openai/any",
        messages=(Message(role="user", content="?"),),
        reply=ChatReply(text="!", usage=usage),
    )
    unanswered = exchange.model_copy(update={"reply": None, "problem": "timeout"})
    for each in (exchange, unanswered, exchange):
        tally.add(ExchangeRecord(exchange=each.model_dump(mode="json"), elapsed=1.0))
    assert (tally.spent.tokens, tally.spent.reasoning_tokens, tally.spent.cost) == (240, 10, 0.5)


def test_a_run_that_goes_on_is_running_again() -> None:
    tally = Tally()
    tally.add(EndedRecord(status="interrupted", reason="", spent={}))
    assert status(tally) == "interrupted"
    tally.add(evaluated(0, 1.0))
    assert status(tally) == "running"
