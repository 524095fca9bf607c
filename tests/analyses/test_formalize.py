"""Requirements in words: sentences with their readings, and readings that the checks send back."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsifier.analyses.formalize import Formalized, formalize
from falsifier.analyses.lint import ranges_of
from falsifier.core.trajectory import Trajectory
from falsifier.errors import ChatError, SpecError
from falsifier.llm.messages import Usage
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.writing import subject_of
from falsifier.search.request import LLMSettings
from falsifier.stl import Formula, Monitor, parse
from falsifier.stl.formula import Not
from falsifier.stl.tell_apart import tell_apart
from tests.analyses.test_lint import SPEC as FINE
from tests.llm.server import Server, Step, serving

SPEC = FINE.replace("0.01", "0.1") + "[requirements.R1]\nformula = 'G[0,20] (speed <= 120)'\n"
UNITS = {"speed": "mph", "rpm": "rev/min", "throttle": "%"}

# Sentences about an automatic transmission, and what engineers mean by them.
SENTENCES: list[tuple[str, list[str]]] = [
    ("The speed reaches 80 within 10 s.", ["F[0,10] (speed >= 80)", "G[10,10] (speed >= 80)"]),
    ("The car does not reach 50 before the engine has reached 4000 rpm.", [
        "G[0,50] (speed < 50) or (speed < 50 or rpm >= 4000) U[0,50] (rpm >= 4000)",
        "(speed < 50) U[0,50] (rpm >= 4000)",
    ]),
    ("Speed is 40 or rpm is below 2000 throughout the last 10 s.", [
        "G[40,50] (abs(speed - 40) <= 1 or rpm < 2000)",
        "G[40,50] (abs(speed - 40) <= 1) or G[40,50] (rpm < 2000)",
        "G[40,50] (speed >= 40 or rpm < 2000)",
    ]),
]  # fmt: skip


@pytest.fixture(scope="module")
def target(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("words") / "my.toml"
    path.write_text(SPEC)
    return str(path)


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with serving() as running:
        yield running


def points(trajectory: Trajectory) -> list[dict[str, Any]]:
    """An example as a language model writes it: points of straight lines."""
    written = []
    for name, column in trajectory.columns.items():
        steps = np.flatnonzero(np.diff(column))
        kept = sorted({0, *steps.tolist(), *(steps + 1).tolist(), len(column) - 1})
        written.append(
            {
                "name": name,
                "times": [float(trajectory.times[k]) for k in kept],
                "values": [float(column[k]) for k in kept],
            }
        )
    return written


def answer(target: str, text: str, **changes: Any) -> dict[str, Any]:
    """A reading with examples that fit its formula."""
    problem = subject_of(target).problem
    formula = parse(text)

    def example(a: Formula, b: Formula) -> list[dict[str, Any]]:
        found = tell_apart(a, b, step=0.1, samples=501, ranges=ranges_of(problem))
        assert found is not None, text
        return points(found)

    units = [{"signal": name, "unit": UNITS.get(name, "")} for name in formula.signals]
    satisfied, violated = example(formula, Not(formula)), example(Not(formula), formula)
    reading = {"formula": text, "meaning": f"It requires {text}.", "units": units}
    return reading | {"satisfied": satisfied, "violated": violated} | changes


def replying(*readings: dict[str, Any]) -> Step:
    return Step(f"I thought about it. {json.dumps({'readings': readings})}")


def ask(server: Server, target: str, *steps: Step, sentence: str = "It is slow.") -> Formalized:
    server.script[:] = steps
    server.received.clear()
    llm = LLMSettings(name="openai/gpt-5-mini", api_base=server.url, cache=False, price=(1.0, 2.0))
    return formalize(target, sentence, llm)


@pytest.fixture(autouse=True)
def key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-test-not-a-key")


@pytest.mark.parametrize(("sentence", "formulas"), SENTENCES, ids=range(len(SENTENCES)))
def test_a_sentence_has_its_readings(server: Server, target: str, sentence: str, formulas: list[str]) -> None:
    replies = [answer(target, text) for text in formulas]
    found = ask(server, target, replying(*replies), sentence=sentence)
    assert [r.formula for r in found.readings] == [parse(text) for text in formulas]
    assert (found.rejected, found.spent.calls) == ((), 1)
    assert found.spent.cost == pytest.approx(140e-6)
    asked = server.received[0].texts
    assert sentence in asked[-1]
    for part in ("- speed (output, real, in mph", "T = 50 s", "G[a,b] (f)", "settle"):
        assert part in asked[-1], part
    for d in found.differences:
        one, other = (found.readings[k - 1].formula for k in (d.first, d.second))
        for trace, yes, no in ((d.only_first, one, other), (d.only_second, other, one)):
            if trace is not None:
                assert Monitor(yes, 0.1, 501).evaluate(trace).robustness >= 0
                assert Monitor(no, 0.1, 501).evaluate(trace).violated
        assert d.only_first is not None or d.only_second is not None


GOOD = "G[0,20] (speed <= 120)"
LOW = [{"name": "speed", "times": [0, 50], "values": [0, 0]}]
HIGH = [{"name": "speed", "times": [0, 50], "values": [200, 200]}]
READING = {"formula": GOOD, "satisfied": LOW, "violated": HIGH}
RISING = [{"name": "speed", "times": [0, 20], "values": [0, 180]}]
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "unknown signal": ({"formula": "G[0,20] (sped <= 120)"}, "unknown signal 'sped'; did you mean 'speed'"),
    "window past the end": ({"formula": "G[0,60] (speed <= 120)"}, "ends at 50 s"),
    "nested windows past the end": ({"formula": "G[0,50] F[0,5] (speed <= 120)"}, "ends at 50 s"),
    "reversed inequality": ({"formula": "G[0,20] (speed >= 120)"}, "you call satisfied is violated"),
    "wrong operator": (
        {"formula": "F[0,20] (speed <= 120)", "violated": RISING},
        "example that you call violated is satisfied",
    ),
    "another unit": ({"units": [{"signal": "speed", "unit": "km/h"}]}, "(1 km/h is 0.621371 mph)"),
    "units that do not fit": ({"formula": "G[0,20] (speed <= rpm)"}, "speed is in mph, rpm in"),
    "no formula": ({"formula": "speed"}, "example that you call satisfied is violated"),
    "syntax": ({"formula": "G[0,20] (speed <= )"}, "position"),
    "window the wrong way round": ({"formula": "G[20,0] (speed <= 120)"}, "ends before it starts"),
    "open window": ({"formula": "G(0,20) (speed <= 120)"}, "open windows"),
    "between samples": ({"formula": "G[0,0.25] (speed <= 120)"}, "not a multiple"),
    "always true": ({"formula": "G[0,20] (throttle <= 100)"}, "no trajectory in range violates it"),
    "a part never true": ({"formula": "G[0,20] (throttle > 120 or speed <= 1)"}, "this part never holds"),
    "an example without a signal": ({"violated": []}, "an example lacks the signal 'speed'"),
    "an example out of order": (
        {"violated": [{"name": "speed", "times": [5, 0], "values": [0, 200]}]},
        "in order",
    ),
    "no margin by ==": ({"formula": "G[0,20] (rpm == 2 -> speed <= 120)"}, "compare with a tolerance"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_reading_goes_back_with_the_reason(server: Server, target: str, what: str) -> None:
    changes, reason = WRONG[what]
    good = {"formula": GOOD, "meaning": "", "units": [], "satisfied": LOW, "violated": HIGH}
    found = ask(server, target, replying(good | changes), replying(good))
    assert [str(r.formula) for r in found.readings] == [GOOD]
    assert len(found.rejected) == 1 and reason in found.rejected[0]
    assert reason in server.received[1].texts[-1] and found.spent.calls == 2


def test_whole_numbers_may_be_equal(server: Server, target: str) -> None:
    formula = "G[0,20] (gear == 3 -> rpm <= 4000)"
    reading = answer(target, formula, units=[{"signal": "rpm", "unit": "U/min"}])
    found = ask(server, target, replying(reading), sentence="Im dritten Gang höchstens 4000 U/min.")
    assert found.rejected == ()
    assert [r.formula for r in found.readings] == [parse(formula)]


def test_a_reading_may_name_what_is_no_output(server: Server, target: str) -> None:
    found = ask(server, target, replying(answer(target, "G[0,20] (engine <= 5000)", units=[])))
    assert found.rejected == ()
    assert found.readings[0].problem.experiment.outputs[-1] == "engine"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("I do not know.", 'no JSON object with "readings"'),
        ('{"readings": []}', "neither "),
        ('{"readings": [{"formula": 3}]}', "readings.0.formula"),
        (json.dumps({"readings": [{"formula": "x"}] * 4}), "readings: "),
    ],
)
def test_replies_of_another_form_are_rejected(server: Server, target: str, content: str, reason: str) -> None:
    found = ask(server, target, Step(content), replying(READING))
    assert len(found.readings) == 1
    assert reason in server.received[1].texts[-1]


def test_the_same_reading_twice_is_one(server: Server, target: str) -> None:
    again = READING | {"formula": "G[0,20] (120 >= speed)"}
    found = ask(server, target, replying(READING, again), replying(READING))
    assert "requires the same as reading 1" in found.rejected[0]


def test_after_the_last_attempt_the_valid_readings_are_kept(server: Server, target: str) -> None:
    bad = READING | {"formula": "G[0,60] (speed <= 120)"}
    found = ask(server, target, replying(READING, bad), replying(bad), replying(bad))
    assert [str(r.formula) for r in found.readings] == [GOOD]
    assert len(found.rejected) == 3
    cannot = Step(json.dumps({"readings": [], "cannot": "No."}))
    assert len(ask(server, target, replying(READING, bad), cannot).readings) == 1
    found = ask(server, target, replying(READING, bad), Step(status=401, message="wrong key"))
    assert len(found.readings) == 1 and "no better answer came" in found.rejected[-1]
    late = ChatError("no complete reply")
    late.lost = Usage(prompt_tokens=70, without_reply=1)
    found = formalize(target, "It is slow.", ScriptedChat([str(replying(READING, bad).content), late]))
    assert (found.spent.calls, found.spent.tokens, found.spent.without_reply) == (2, 70, 1)
    with pytest.raises(ChatError, match="no valid reply in 3 attempts"):
        ask(server, target, *[replying(bad)] * 3)


def test_readings_on_different_grids_are_told_apart(server: Server, target: str, tmp_path: Path) -> None:
    free = tmp_path / "free.toml"
    free.write_text(SPEC.replace("output_interval = 0.1\n", ""))
    texts = ["G[0,12.5] (speed <= 120)", "G[0,0.24] (speed <= 120)"]
    found = ask(server, str(free), replying(*(READING | {"formula": text} for text in texts)))
    assert [str(r.formula) for r in found.readings] == texts
    assert found.differences[0].only_first is None
    assert found.differences[0].only_second is not None


def test_an_empty_sentence_is_not_sent(server: Server, target: str) -> None:
    with pytest.raises(SpecError, match="expected a sentence"):
        ask(server, target, sentence=" ")
    assert server.received == []
