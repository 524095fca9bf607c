"""What travels, and what of it may be recorded and shown."""

import pytest

from falsifier.llm.messages import ChatReply, Exchange, Message, cleaned


def test_exchanges_come_back_whole_and_an_empty_field_of_few_messages_is_not_written() -> None:
    messages = (Message(role="system", content="always", stable=6), Message(role="user", content="now"))
    exchange = Exchange(llm="m", messages=messages, reply=ChatReply(text="3"))
    written = exchange.model_dump_json()
    assert Exchange.model_validate_json(written) == exchange
    assert written.count('"stable"') == 1


def reply_with(text: str) -> ChatReply:
    return ChatReply(text=text, reasoning=text, finish_reason=text)


def test_secrets_are_removed_from_every_part(monkeypatch: pytest.MonkeyPatch) -> None:
    key = "an-ordinary-looking-key"
    assert cleaned(reply_with(f"your key is {key}"), [key]) == reply_with("your key is [redacted]")
    monkeypatch.setenv("MISTRAL_API_KEY", key)
    assert cleaned(reply_with(f"({key})")) == reply_with("([redacted])")


def test_an_ordinary_reply_stays_as_it_is_without_what_a_terminal_acts_on() -> None:
    plain = reply_with('{"rationale": "sk-learn and pk-values", "signals": []}')
    assert cleaned(plain, ["", "short"]) == plain
    assert cleaned(reply_with("\x1b]0;title\x07\x1b[31mtext")) == reply_with("text")
