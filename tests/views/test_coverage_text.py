import json

from falsifier import Candidate, Signal
from falsifier.analyses.coverage import coverage_of
from falsifier.record.manifest import InputRecord
from falsifier.views.coverage_text import coverage_json, coverage_text
from tests.analyses.test_coverage import described

RANGES = (
    InputRecord(name="throttle", low=0.0, high=100.0, unit="%"),
    InputRecord(name="brake", low=0.0, high=10.0),
)
STEP = Signal((0.0, 5.0), (0.0, 95.0), "constant")
FOUND = coverage_of(
    described(*RANGES), [(Candidate({"throttle": STEP, "brake": Signal((0.0,), (5.5,))}), None)]
)


def test_what_was_never_tried_is_said_in_words() -> None:
    text = coverage_text(FOUND, "AT1")
    assert text.startswith("AT1: what 1 simulation tried\n")
    for part in (
        "throttle [%]  0 to 100  0 to 95",
        "2 of 10",
        "steps in 1",
        "throttle             values 10 to 90\n",
        "changes: slow, medium, fast and steps\n",
        "throttle with brake  98 of 100 combinations at the same time",
        "gear  nothing recorded; never N, D, R",
    ):
        assert part in text, text


def test_json_has_the_same() -> None:
    told = json.loads(json.dumps(coverage_json(FOUND)))
    assert told["searched"][0]["gaps"] == [[10.0, 90.0]]
    assert told["searched"][0]["tried"] == [0.0, 95.0]
    assert told["pairs"] == [{"names": ["throttle", "brake"], "combinations": 100, "tried": 2}]
    assert told["modes"][0]["never"] == ["N", "D", "R"]
