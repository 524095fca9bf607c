"""Odd replies: which are read, and what is said of those that are not.

    python -m bench.replies > bench/replies.md

Each is the same good reply (two inputs of three and two control points, one parameter) with one mistake.
"""

import argparse
import json
from collections.abc import Iterator

from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.core.space import SearchSpace
from falsifier.llm.conversation import converse
from falsifier.llm.messages import ChatReply, ChatRequest, Exchange, Message
from falsifier.llm.replies import ReplyForm
from falsifier.llm.scripted import ScriptedChat

SPACE = SearchSpace(
    (InputRange("throttle", 0.0, 100.0, control_points=3), InputRange("brake", 0.0, 325.0, control_points=2)),
    (ParameterRange("mass", 900.0, 1100.0),),
    50.0,
)
SIGNALS = [{"name": "throttle", "values": [1, 2, 3]}, {"name": "brake", "values": [0, 5]}]
GOOD = {"rationale": "because", "signals": SIGNALS, "parameters": [{"name": "mass", "value": 950}]}
TEXT = json.dumps(GOOD)
# What every reply means.
WANTED = {"throttle": (1.0, 2.0, 3.0), "brake": (0.0, 5.0)}


def odd_replies() -> Iterator[tuple[str, ChatReply]]:
    """A name for the mistake, and the reply with it."""
    by_name = {"throttle": [1, 2, 3], "brake": [0, 5]}
    texts = {
        "trailing comma": TEXT.replace("[1, 2, 3]", "[1, 2, 3,]"),
        "comment": TEXT.replace('"signals"', '// the inputs\n"signals"'),
        "trailing comma in the object": TEXT[:-1] + ",}",
        "comment of Python": TEXT.replace("[1,", "[ # slow\n 1,"),
        "comment of C": TEXT.replace("[1,", "[ /* slow */ 1,"),
        "quotes within a text": TEXT.replace("because", 'the "brake" stays'),
        "single quotes": TEXT.replace('"', "'"),
        "no quotes around keys": TEXT.replace('"signals"', "signals").replace('"name"', "name"),
        "missing comma": TEXT.replace('"because",', '"because"'),
        "full-width punctuation": TEXT.replace(":", "：").replace(",", "，"),
        "curly quotes": TEXT.replace('"', "”"),
        "keys in capitals": TEXT.replace("signals", "Signals").replace("values", "VALUES"),
        "Python's None": TEXT.replace('"because"', "None"),
        "fence and prose": f"Here it is:\n```json\n{TEXT}\n```\nGood luck!",
        "thought before": f'<think>maybe {{"signals": []}}</think>{TEXT}',
        "draft before": f'{{"signals": [], "rationale": "draft"}} and finally {TEXT}',
        "signals by name": json.dumps(GOOD | {"signals": by_name}),
        "parameters by name": json.dumps(GOOD | {"parameters": {"mass": 950}}),
        "bare list of signals": json.dumps([*SIGNALS]),
        "list of candidates": json.dumps([GOOD]),
        "candidates under a key": json.dumps({"candidates": [GOOD]}),
        "numbers as texts": TEXT.replace("[1, 2, 3]", '["1", "2", "3"]'),
        "bare list of numbers": "[1, 2, 3, 0, 5, 950]",
        "point": '{"point": [1, 2, 3, 0, 5, 950]}',
        "null for the rationale": json.dumps(GOOD | {"rationale": None}),
        "superfluous remark": json.dumps(GOOD | {"confidence": 0.9}),
        "value a rounding beyond its range": TEXT.replace("[0, 5]", "[-0.0001, 5]"),
        "cut off": TEXT[:-20],
        "omission": TEXT.replace("2, 3", "..., 3"),
        "arithmetic": TEXT.replace("[1, 2, 3]", "[2/2, 2, 3]"),
        "bracket missing": TEXT.replace("[1, 2, 3]", "[1, 2, 3"),
        "unknown input": TEXT.replace("throttle", "throtle"),
        "input left out": json.dumps(GOOD | {"signals": SIGNALS[:1]}),
        "input twice": json.dumps(GOOD | {"signals": [*SIGNALS, SIGNALS[0]]}),
        "parameter left out": json.dumps(GOOD | {"parameters": []}),
        "wrong number of values": TEXT.replace("[1, 2, 3]", "[1, 2]"),
        "misspelt key in a signal": TEXT.replace("values", "value"),
        "value beyond its range": TEXT.replace("[0, 5]", "[0, 500]"),
        "infinite value": TEXT.replace("[0, 5]", "[0, Infinity]"),
        "other keys": '{"inputs": [1, 2, 3]}',
        "empty": "",
        "prose": "I would press the throttle.",
        "refusal": "I cannot help with that.",
    }
    for name, text in texts.items():
        yield name, ChatReply(text=text)
    yield "JSON in the reasoning only", ChatReply(text="", reasoning=TEXT)
    yield "refusal, told by the server", ChatReply(text="I will not.", finish_reason="refusal")
    yield "cut off, told by the server", ChatReply(text=TEXT[:-20], finish_reason="length")


def outcome(reply: ChatReply) -> str:
    """Whether a reply is read as what was meant; if not, what an LLM is told."""
    exchanges: list[Exchange] = []
    chat = ScriptedChat([reply])
    request = ChatRequest(messages=(Message(role="user", content="?"),))
    try:
        candidates = converse(chat, request, ReplyForm(SPACE).read, exchanges.append, reasks=0)
    except Exception:
        return f"rejected: {exchanges[0].problem}"
    signals = {name: s.values for name, s in candidates[0].signals.items()}
    return "read" if signals == WANTED else f"read as something else: {signals}"


def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter).parse_args()
    print("# Odd replies\n\nMade by `python -m bench.replies`; how, is said there.\n")
    print("| the reply has | it is |\n|---|---|")
    found = [(name, outcome(reply)) for name, reply in odd_replies()]
    for name, came in found:
        print(f"| {name} | {came.replace('|', '/')} |")
    print(f"\n{sum(came == 'read' for _, came in found)} of {len(found)} are read as they were meant.")


if __name__ == "__main__":
    main()
