import json
from dataclasses import replace

import numpy as np

from falsifier import Candidate, Signal
from falsifier.analyses.coverage import coverage_of
from falsifier.analyses.formalize import formalize
from falsifier.core.ranges import Range
from falsifier.core.trajectory import Trajectory
from falsifier.llm.scripted import ScriptedChat
from falsifier.views.analyses_text import coverage_json, coverage_text, formalized_text, trace_lines
from tests.analyses.test_coverage import described

RANGES = (Range(name="throttle", low=0.0, high=100.0, unit="%"), Range(name="brake", low=0.0, high=10.0))
STEP = Signal((0.0, 5.0), (0.0, 95.0), "constant")
FOUND = coverage_of(
    described(*RANGES), [(Candidate({"throttle": STEP, "brake": Signal((0.0,), (5.5,))}), None)]
)


def test_what_was_never_tried_is_said_in_words() -> None:
    text = coverage_text(FOUND, "AT1")
    assert text.startswith("AT1: what 1 simulation tried\n")
    for part in ("2 of 10", "steps in 1", "values 10 to 90\n", "98 of 100 combinations", "never N, D, R"):
        assert part in text, text
    assert "the whole range takes 43200 s or more" in coverage_text(replace(FOUND, stop_time=86400.0), "DAY")


def test_json_has_the_same() -> None:
    told = json.loads(json.dumps(coverage_json(FOUND)))
    assert told["searched"][0]["gaps"] == [[10.0, 90.0]]
    assert told["searched"][0]["tried"] == [0.0, 95.0]
    assert told["pairs"] == [{"names": ["throttle", "brake"], "combinations": 100, "tried": 2}]
    assert told["modes"][0]["never"] == ["N", "D", "R"]


SOME = [{"name": "speed", "times": [0, 1, 2, 50], "values": [0, 100, 0, 0]}]
NONE = [{"name": "speed", "times": [0, 50], "values": [0, 0]}]
ALL = [{"name": "speed", "times": [0, 50], "values": [200, 200]}]
READINGS = [
    {"formula": "F[0,10] (speed >= 80)", "meaning": "at some time", "satisfied": SOME, "violated": NONE},
    {"formula": "G[10,10] (speed >= 80)", "meaning": "at 10 s", "satisfied": ALL, "violated": SOME},
]


def test_readings_are_told_with_words_examples_and_cost() -> None:
    found = formalize("AT1", "Fast at 10 s.", ScriptedChat([json.dumps({"readings": READINGS})]))
    text = formalized_text(found)
    for part in (
        "1. F[0,10] (speed >= 80)\n   in words   At some time from 0 to 10 s, speed is at least 80.\n",
        "   meant      at 10 s",
        "only 1, not 2, is satisfied by (0 to 50 s)\n   speed  ",
        "1 request",
        "0.0000 US dollars",
    ):
        assert part in text, part


def test_a_reason_that_occurred_again_is_told_once_in_one_line() -> None:
    wrong = json.dumps({"readings": [{**READINGS[0], "formula": "F[0,10] (speed >= 80"}, READINGS[0]]})
    found = formalize("AT1", "Fast.", ScriptedChat([wrong] * 3))
    assert len(found.rejected) > 1
    (line,) = (line for line in formalized_text(found).splitlines() if line.startswith("rejected"))
    assert line.endswith("(position 21); hint: it closes the '(' at position 9")


def test_each_signal_has_its_name_and_range() -> None:
    times = np.linspace(0, 1, 4)
    found = trace_lines(
        Trajectory(times, {"x": np.array([0.0, 0.0, 2.0, 2.0]), "speed": np.full(4, 3.0)}), width=4
    )
    assert found == ["x      ▁▁██  0 to 2", "speed  ▁▁▁▁  constant 3"]
