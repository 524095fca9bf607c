import json

from falsifier.analyses.formalize import formalize
from falsifier.llm.replay import ScriptedChat
from falsifier.problem.template_advice import Advice
from falsifier.views.readings_text import advice_text, formalized_json, formalized_text

SOME = [{"name": "speed", "times": [0, 1, 2, 50], "values": [0, 100, 0, 0]}]
NONE = [{"name": "speed", "times": [0, 50], "values": [0, 0]}]
ALL = [{"name": "speed", "times": [0, 50], "values": [200, 200]}]
READINGS = [
    {"formula": "F[0,10] (speed >= 80)", "meaning": "at some time", "satisfied": SOME, "violated": NONE},
    {"formula": "G[10,10] (speed >= 80)", "meaning": "at 10 s", "satisfied": ALL, "violated": SOME},
]


def test_readings_are_told_with_words_examples_and_cost() -> None:
    found = formalize(
        "AT1", "Fast at 10 s.", ScriptedChat([json.dumps({"readings": READINGS})]), nominal=False
    )
    text = formalized_text(found)
    for part in (
        "1. F[0,10] (speed >= 80)\n   in words   At some time from 0 to 10 s, speed is at least 80.\n",
        "   meant      at 10 s",
        "only 1, not 2, is satisfied by (0 to 50 s)\n   speed  ",
        "1 request",
        "0.0000 US dollars",
    ):
        assert part in text, part
    content = formalized_json(found)
    assert [r["formula"] for r in content["readings"]] == [r["formula"] for r in READINGS]
    assert content["differences"][0]["only_first"]["speed"][0][0] == 0.0
    assert json.loads(json.dumps(content)) == content


def test_advice_is_told_as_a_section() -> None:
    advice = [Advice("rise", "it rises", '[requirements.NAME]\ntemplate = "rise"')]
    assert advice_text("80 in 2 s", advice).startswith("rise: it rises\n  [requirements.NAME]\n")
    assert "note: Formulas compare values" in advice_text("after each step", advice)
