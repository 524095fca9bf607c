"""What travels, and what of it may be recorded and shown."""

import pytest

from falsifier.llm.messages import LONGEST_REPLY, ChatReply, Exchange, ToolCall, cleaned
from tests.llm.support import PLAIN, ask_with_tools, calling


def test_exchanges_come_back_whole_and_without_calls_no_field_of_theirs_is_written() -> None:
    _, _, exchanges = ask_with_tools(calling(1, 2), "3")
    assert [bool(e.reply and e.reply.tool_calls) for e in exchanges] == [True, False]
    assert [Exchange.model_validate_json(e.model_dump_json()) for e in exchanges] == exchanges
    plain = Exchange(llm="m", messages=PLAIN.messages, reply=ChatReply(text="3")).model_dump_json()
    assert "tool" not in plain and "echo" not in plain


KEY = "an-ordinary-looking-key"


def reply_with(text: str) -> ChatReply:
    call = ToolCall(id=text, name=text, arguments=text, echo={"signature": text})
    return ChatReply(
        text=text, reasoning=text, finish_reason=text, tool_calls=(call,), echo={"thought": text}
    )


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


def test_a_long_reply_is_cut() -> None:
    call = ToolCall(id="1", name="f", arguments="")
    clean = cleaned(ChatReply(text="x" * (LONGEST_REPLY + 5), tool_calls=(call,) * 1000))
    assert len(clean.text) == LONGEST_REPLY
    assert len(clean.tool_calls) == 100
