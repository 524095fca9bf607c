"""Replies that an LLM should not send: rejected with a reason, in a time proportional to their length."""

import json
import time
from collections.abc import Callable

import pytest

from falsifier.core.ranges import Freedom, InputRange, ParameterRange
from falsifier.core.space import SearchSpace
from falsifier.llm.conversation import RejectedReplyError, converse
from falsifier.llm.messages import LONGEST_REPLY, ChatReply, ChatRequest, Exchange, Message
from falsifier.llm.replies import ReplyForm
from falsifier.llm.scripted import ScriptedChat

FREE = Freedom(max_control_points=50, min_interval=0.1)
SPACE = SearchSpace(
    (InputRange("u", -1.0, 1.0, control_points=3, interpolation="linear", hold=None, free=FREE),),
    (ParameterRange("k", 0.0, 2.0),),
    10.0,
)
FORM = ReplyForm(SPACE)
QUESTION = ChatRequest(messages=(Message(role="user", content="?"),), reply_schema=FORM.schema())
# Reading a megabyte takes well under a second; with a time that grows with the square of the length, hours.
CPU_SECONDS = 60.0


def filled(unit: str) -> Callable[[int], str]:
    return lambda size: unit * (size // len(unit))


def inside(before: str, unit: str, after: str) -> Callable[[int], str]:
    return lambda size: before + unit * ((size - len(before) - len(after)) // len(unit)) + after


VALUES = '{"rationale": "", "signals": [{"name": "u", "values": [%s]}], "parameters": []}'
NUMBER = VALUES.split("%s")
LONG = {
    "thoughts that begin": filled("<think>"),
    "thoughts that end": filled("</think>"),
    "thoughts": filled("<think></think>"),
    "objects that begin": filled('{"'),
    "objects in objects": filled('{"a":'),
    "objects that break": filled('{"a" '),
    "objects of lines": filled('{"\n'),
    "lists in lists": inside('{"signals":', "[", ""),
    "empty objects": filled("{}"),
    "candidates": inside('{"candidates":[', '{"point":[1,2]},', '{"point":[1]}]}'),
    "wrong candidates": inside('{"candidates":[', '{"signals":7},', "{}]}"),
    "braces": filled("{"),
    "spaces after braces": inside("{", " ", "x"),
    "quotes": filled('"'),
    "digits in a string": inside(f'{NUMBER[0]}"', "1", f'x"{NUMBER[1]}'),
    "a run of digits": inside(f'{NUMBER[0]}"1 x ', "1", f'"{NUMBER[1]}'),
    "spaces in a run": inside(f'{NUMBER[0]}"1', " ", f'x"{NUMBER[1]}'),
    "an integer": inside(NUMBER[0], "9", NUMBER[1]),
    "a fraction": inside(f"{NUMBER[0]}0.", "9", NUMBER[1]),
    "an exponent": inside(f"{NUMBER[0]}1e", "9", NUMBER[1]),
    "numbers": inside(NUMBER[0], "1,", f"1{NUMBER[1]}"),
    "runs": inside(NUMBER[0], '"1 x 99999",', f"1{NUMBER[1]}"),
    "strings": inside(NUMBER[0], '"no",', f"1{NUMBER[1]}"),
    "signals": inside('{"signals":[', '{"name":"u","values":[1]},', '{"name":"v","values":[]}]}'),
    "parameters": inside('{"parameters":[', '{"name":"k","value":1},', '{"name":"k","value":"x"}]}'),
    "names": inside('{"signals":[{"name":"', "u", '","values":[1]}]}'),
    "rationale": inside('{"rationale":"', "\\u001b[31m", '"}'),
    "unknown keys": lambda size: json.dumps({str(i): i for i in range(size // 16)} | {"signals": 1}),
    "escapes": inside('{"', "\\u0000", '":1,"signals":[]}'),
    "emptiness": filled(" \n"),
}


@pytest.mark.parametrize("reply", LONG)
def test_the_time_to_read_a_reply_grows_with_its_length(reply: str) -> None:
    text = LONG[reply](LONGEST_REPLY - 1)
    started = time.thread_time()
    try:
        FORM.read(text)
    except RejectedReplyError as rejection:
        assert len(str(rejection)) < 1300
    assert time.thread_time() - started < CPU_SECONDS


def test_a_reply_longer_than_the_limit_is_rejected_and_not_recorded_in_full() -> None:
    exchanges: list[Exchange] = []
    good = '{"signals": [{"name": "u", "values": [0, 0, 0]}], "parameters": [{"name": "k", "value": 1}]}'
    chat = ScriptedChat([ChatReply(text=good + " " * 10 * LONGEST_REPLY), ChatReply(text=good)])
    converse(chat, QUESTION, FORM.read, exchanges.append)
    assert exchanges[0].problem == f"the reply is too long, {LONGEST_REPLY} characters or more"
    assert len(exchanges[0].model_dump_json()) < 2 * LONGEST_REPLY
    assert len(exchanges[1].messages[-1].content) + len(exchanges[1].messages[-2].content) < 10_000


def test_a_reply_that_breaks_the_reader_is_recorded_all_the_same() -> None:
    exchanges: list[Exchange] = []

    def read(text: str) -> None:
        raise ZeroDivisionError("a defect")

    with pytest.raises(ZeroDivisionError):
        converse(ScriptedChat(["paid for"]), QUESTION, read, exchanges.append)
    (recorded,) = exchanges
    assert recorded.reply is not None
    assert (recorded.reply.text, recorded.problem) == ("paid for", "ZeroDivisionError: a defect")
