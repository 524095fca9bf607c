"""What travels, and what of it may be recorded and shown."""

import pytest

from falsifier.llm.messages import ChatReply, Exchange, Message, cleaned


def test_exchanges_come_back_whole_and_an_empty_field_of_few_messages_is_not_written() -> None:
    messages = (Message(role="system", content="always", stable=6), Message(role="user", content="now"))
    exchange = Exchange(llm="m", messages=messages, reply=ChatReply(text="3"))
    written = exchange.model_dump_json()
    assert Exchange.model_validate_json(written) == exchange
    assert written.count('"stable"') == 1


KEY = "an-ordinary-looking-key"


def reply_with(text: str) -> ChatReply:
    return ChatReply(text=text, reasoning=text, finish_reason=text)


def test_secrets_are_removed_from_every_part(monkeypatch: pytest.MonkeyPatch) -> None:
    assert cleaned(reply_with(f"your key is {KEY}"), [KEY]) == reply_with("your key is [redacted]")
    monkeypatch.setenv("MISTRAL_API_KEY", KEY)
    assert KEY not in cleaned(reply_with(f"({KEY})")).model_dump_json()


def test_escape_sequences_are_removed_from_what_is_shown() -> None:
    clean = cleaned(ChatReply(text="\x1b]0;title\x07text", reasoning="\x1b[31mred"))
    assert (clean.text, clean.reasoning) == ("text", "red")


def test_an_ordinary_reply_stays_as_it_is() -> None:
    plain = reply_with('{"rationale": "sk-learn and pk-values", "signals": []}')
    assert cleaned(plain, ["", "short"]) == plain
