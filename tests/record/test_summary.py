from falsifier.evaluation.confirm import Outcome
from falsifier.llm.messages import ChatReply, Exchange, Message, Usage
from falsifier.record import records
from falsifier.record.summary import Summary
from falsifier.search.budget import Spent
from falsifier.search.findings import Finding
from falsifier.stl.monitor import Verdict


def status(summary: Summary) -> str:
    """Read the status anew: the type checker takes an attribute that was compared once for settled."""
    return summary.status


def evaluated(index: int, robustness: float | None) -> records.EvaluatedRecord:
    verdict = None
    if robustness is not None:
        verdict = Verdict(robustness=robustness, critical_time=1.0, predicate="x <= 1", values={"x": 2.0})
    status = "ok" if verdict else "failed"
    return records.EvaluatedRecord(
        index=index, status=status, verdicts={"R": verdict}, seconds=0.5, elapsed=index + 1
    )


def asked(first: int, count: int) -> records.AskedRecord:
    candidates = [{"signals": {}, "parameters": {"p": float(i)}} for i in range(count)]
    return records.AskedRecord(
        first=first, n=count, candidates=candidates, seconds=0.1, requirement="R", elapsed=0.1
    )


def confirmed(index: int, outcome: Outcome, reason: str, spent: Spent) -> records.ConfirmedRecord:
    return records.ConfirmedRecord(
        index=index,
        requirement="R",
        outcome=outcome,
        robustness=-1.0,
        reference=-1.0,
        reason=reason,
        spent=spent,
    )


def test_a_growing_journal_is_counted_line_by_line() -> None:
    summary = Summary()
    assert status(summary) == "waiting"
    summary.add(asked(0, 1))
    assert status(summary) == "running"
    for i, robustness in enumerate([2.0, None, 1.0, 1.0, -3.0]):
        summary.add(evaluated(i, robustness))
    assert (summary.best, summary.best_robustness) == (4, 1.0), "a violation is none before it is confirmed"
    spent = summary.spent
    assert (spent.simulations, spent.simulation_seconds, spent.seconds) == (5, 2.5, 5.0)
    summary.add(confirmed(2, "fragile", "vanishes", Spent()))
    assert status(summary) == "running"
    summary.add(confirmed(4, "confirmed", "yes", Spent(simulations=5, seconds=9.0, cost=None)))
    assert (summary.counterexample, summary.best_robustness) == (4, -3.0)
    assert summary.unconfirmed == {2: "fragile: vanishes"}
    assert (summary.status, summary.spent.seconds, summary.spent.cost) == ("falsified", 9.0, None)


def test_what_a_search_could_not_show_before_it_was_resumed_is_forgotten() -> None:
    summary, untested = Summary(), Finding(kind="disjunct", text="x <= 1 always held")
    ended = {"status": "interrupted", "reason": "stopped", "spent": Spent(), "findings": {"R": [untested]}}
    before: list[records.Record] = [asked(0, 1), evaluated(0, 2.0), records.EndedRecord.model_validate(ended)]
    for record in before:
        summary.add(record)
    assert list(summary.findings) == [untested]
    for later in (asked(1, 1), evaluated(1, -3.0), confirmed(1, "confirmed", "yes", Spent())):
        summary.add(later)
    assert (status(summary), list(summary.findings)) == ("falsified", [])


def test_a_violation_that_was_refuted_is_not_the_best_robustness() -> None:
    summary = Summary()
    for index, outcome in enumerate(("refuted", "confirmed")):
        summary.add(evaluated(index, index - 5.0))
        summary.add(confirmed(index, outcome, "", Spent()))  # type: ignore[arg-type]
        assert (summary.best, summary.best_robustness) == (0, (None, -4.0)[index])


def test_tokens_and_money_of_a_running_run_come_from_its_exchanges() -> None:
    summary = Summary()
    usage = Usage(prompt_tokens=100, completion_tokens=20, reasoning_tokens=5, cost=0.25)
    exchange = Exchange(
        llm="openai/any",
        messages=(Message(role="user", content="?"),),
        reply=ChatReply(text="!", usage=usage),
    )
    unanswered = exchange.model_copy(update={"reply": None, "problem": "timeout"})
    for each in (exchange, unanswered, exchange):
        summary.add(records.ExchangeRecord(exchange=each, elapsed=1.0))
    assert (summary.spent.tokens, summary.spent.reasoning_tokens, summary.spent.cost) == (240, 10, 0.5)
