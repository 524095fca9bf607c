"""Requirements in words: the question, and what is read from replies."""

import json

import numpy as np
import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.model import ModelInfo, Variable
from falsifier.errors import SpecError
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.formalizing import ExampleSignal, example_trajectory, formalizing_messages, read_readings
from falsifier.problem.templates import TEMPLATES

INFO = ModelInfo(
    "pump",
    description="A pump with a tank",
    variables=(
        Variable("mode", "enumeration", "input", "discrete", literals={"off": 0, "on": 1}),
        Variable("level", causality="output", unit="m", low=0.0, high=2.5, description="Level of the tank"),
        *(Variable(f"inner{k}") for k in range(200)),
    ),
)


def test_the_question_has_signals_language_templates_and_the_sentence() -> None:
    system, user = formalizing_messages("The tank never runs dry.", INFO, Experiment(20.0, 0.05, ("level",)))
    assert (system.role, user.role) == ("system", "user")
    for part in (
        "The model pump: A pump with a tank",
        "from 0 to T = 20 s and sampled every 0.05 s",
        "- level (output, real, in m, at least 0, at most 2.5): Level of the tank",
        "- mode (input, enumeration, at least 0, at most 1, 0 = off, 1 = on)",
        "and 82 more variables",
        "The requirement:\nThe tank never runs dry.",
        "G[a,b] (f)",
        '{"signal": name, "unit": the unit',  # servers that ignore the schema tell no form
        '{"name": signal,\n  "times": [s], "values": [...]}',
        *(f"- {name}: {template.summary}" for name, template in TEMPLATES.items()),
    ):
        assert part in user.content, part


TIMES = np.linspace(0.0, 2.0, 5)


def test_the_last_object_counts_and_thoughts_do_not() -> None:
    draft, final = ({"readings": [{"formula": f}]} for f in ("x > 1", "x > 2"))
    text = f"<think>{json.dumps(draft)}</think> First {json.dumps(draft)}, better {json.dumps(final)}"
    assert [r.formula for r in read_readings(text)] == ["x > 2"]


def test_examples_are_straight_lines_between_points() -> None:
    signals = [ExampleSignal(name="x", times=[0, 1, 1, 2], values=[0, 2, 5, 5])]
    found = example_trajectory(signals, ["x"], TIMES)
    assert found["x"][1] == 1
    assert found["x"][3:].tolist() == [5, 5]
    with pytest.raises(RejectedReplyError, match="lacks the signal 'y'"):
        example_trajectory(signals, ["x", "y"], TIMES)
    with pytest.raises(RejectedReplyError, match="as many times as values"):
        example_trajectory([ExampleSignal(name="x", times=[0], values=[0, 2])], ["x"], TIMES)


def test_a_sentence_that_no_formula_says_is_told_so() -> None:
    reply = '{"readings": [], "cannot": "The model has no signal that is the rate of speed."}'
    with pytest.raises(
        SpecError, match=r"no formula .*no signal that is the rate of speed\.\nFormulas compare"
    ):
        read_readings(reply)
    with pytest.raises(RejectedReplyError, match='neither "readings" nor a reason'):
        read_readings('{"readings": [], "cannot": " "}')
    for cannot in ('"ignored"', "null"):
        (reading,) = read_readings(f'{{"readings": [{{"formula": "x > 2"}}], "cannot": {cannot}}}')
        assert reading.formula == "x > 2"
