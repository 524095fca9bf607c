from pathlib import Path

import pytest

from falsifier.errors import JournalError
from falsifier.llm.messages import ChatReply, Exchange, Message, Usage
from falsifier.search.journal import (
    AskedRecord,
    ConfirmedRecord,
    EndedRecord,
    EvaluatedRecord,
    ExchangeRecord,
    VerdictRecord,
)
from falsifier.search.tally import Tally, read_candidate


def status(tally: Tally) -> str:
    """Read the status anew: the type checker takes an attribute that was compared once for settled."""
    return tally.status


def evaluated(index: int, robustness: float | None) -> EvaluatedRecord:
    verdict = None
    if robustness is not None:
        verdict = VerdictRecord(
            robustness=robustness, critical_time=1.0, predicate="x <= 1", values={"x": 2.0}
        )
    return EvaluatedRecord(index=index, status="ok" if verdict else "failed", verdict=verdict, seconds=0.5)


def test_a_growing_journal_is_counted_line_by_line() -> None:
    tally = Tally()
    assert status(tally) == "waiting"
    tally.feed(AskedRecord(first=0, n=1, candidates=[], seconds=0.1).model_dump_json().encode(), "here")
    assert status(tally) == "running"
    for i, robustness in enumerate([2.0, None, 1.0, 1.0, -3.0]):
        tally.add(evaluated(i, robustness))
    assert (tally.best, tally.best_robustness) == (4, -3.0)
    assert (tally.spent.simulations, tally.spent.simulation_seconds) == (5, 2.5)
    tally.add(ConfirmedRecord(index=2, outcome="fragile", robustness=1.0, reference=1.0, reason="vanishes"))
    tally.add(ConfirmedRecord(index=4, outcome="confirmed", robustness=-3.0, reference=-3.0, reason="yes"))
    assert tally.counterexample == 4
    assert tally.unconfirmed == {2: "fragile: vanishes"}
    assert status(tally) == "running"
    tally.add(
        EndedRecord(
            status="falsified", reason="yes", spent={"simulations": 5.0, "seconds": 9.0, "cost": None}
        )
    )
    assert (tally.status, tally.spent.seconds, tally.spent.cost) == ("falsified", 9.0, None)


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
        tally.add(ExchangeRecord(exchange=each.model_dump(mode="json")))
    assert (tally.spent.tokens, tally.spent.reasoning_tokens, tally.spent.cost) == (240, 10, 0.5)


def test_a_run_that_goes_on_is_running_again() -> None:
    tally = Tally()
    tally.add(EndedRecord(status="interrupted", reason="", spent={}))
    assert status(tally) == "interrupted"
    tally.add(evaluated(0, 1.0))
    assert status(tally) == "running"


def test_candidates_are_found_in_batches(tmp_path: Path) -> None:
    lines = [
        AskedRecord(first=0, n=2, candidates=[{"origin": "a"}, {"origin": "b"}], seconds=0.1),
        evaluated(0, 1.0),
        AskedRecord(first=2, n=2, candidates=[{"origin": "c"}], seconds=0.1),
    ]
    (tmp_path / "journal.jsonl").write_text("".join(f"{line.model_dump_json()}\n" for line in lines))
    assert [read_candidate(tmp_path, i)["origin"] for i in range(3)] == ["a", "b", "c"]
    with pytest.raises(JournalError, match="no candidate 3"):
        read_candidate(tmp_path, 3)
