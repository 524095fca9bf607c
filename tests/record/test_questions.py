import pytest

from falsifier.errors import JournalError
from falsifier.llm.messages import ChatReply, Exchange, Message
from falsifier.record.questions import exchange_before
from falsifier.record.records import AskedRecord, ExchangeRecord, Record


def asked(first: int, *candidates: dict[str, str]) -> AskedRecord:
    return AskedRecord(
        first=first,
        n=len(candidates),
        candidates=list(candidates),
        seconds=0.0,
        requirement="R",
        elapsed=0.0,
    )


def exchange(text: str) -> ExchangeRecord:
    said = Exchange(llm="m", messages=(Message(role="user", content=text),), reply=ChatReply(text="{}"))
    return ExchangeRecord(exchange=said.model_dump(mode="json"), elapsed=0.0)


def test_the_last_question_before_a_sample_is_found() -> None:
    records: list[Record] = [
        asked(0, {}),
        exchange("a"),
        exchange("b"),
        asked(1, {}, {}),
        exchange("c"),
        asked(3, {}),
    ]
    found = [exchange_before(records, i) for i in range(4)]
    assert [e and e.messages[0].content for e in found] == [None, "b", "b", "c"]
    with pytest.raises(JournalError, match="no sample 5"):
        exchange_before(records, 4)
