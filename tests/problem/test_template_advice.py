import tomllib

import pytest

from falsifier.core.model import ModelInfo, Variable
from falsifier.problem.spec import parse_spec
from falsifier.problem.template_advice import advised_templates, hint, mentioned_signals
from falsifier.problem.templates import TEMPLATES

INFO = ModelInfo(
    "car",
    variables=(
        Variable("speed", causality="output", description="Speed of the car"),
        Variable("engineRpm", causality="output", description="Turns per minute"),
        Variable("brake", causality="input"),
    ),
)


@pytest.mark.parametrize(
    ("sentence", "template"),
    [
        ("The speed settles within 2 % of the reference at most 3 s after each step.", "settles"),
        ("The overshoot of the speed is at most 10 %.", "overshoot"),
        ("The speed reaches 80 in 10 s.", "rise"),
        ("Whenever the brake is pressed, the speed drops within 2 s.", "response"),
        ("The speed stays between 20 and 80.", "stays_within"),
        ("Heating and cooling are never on together.", "never_together"),
        ("The pump stays on for at least 5 s.", "dwell"),
        ("The valve moves by no more than 10 % per second.", "ramp_limit"),
        ("The gate opens only after the lock is released.", "order"),
    ],
)
def test_words_of_a_sentence_point_to_a_template(sentence: str, template: str) -> None:
    assert advised_templates(sentence, INFO)[0].template == template


def test_advice_is_a_section_to_fill_in() -> None:
    advice = advised_templates("The speed reaches 80 in 10 s.", INFO)[0]
    assert advice.numbers == ("80", "10")
    assert advice.section.splitlines()[:3] == ["[requirements.NAME]", 'template = "rise"', 'signal = "speed"']
    filled = advice.section.replace("REFERENCE", "80").replace("SECONDS", "10")
    spec = parse_spec(tomllib.loads(f'[model]\nfmu = "a.fmu"\n{filled}'), file="my.toml")
    assert spec.requirements["NAME"].expanded(50.0) == "F[0,10] (speed >= 72)"


def test_every_template_has_a_section_that_can_be_filled_in() -> None:
    sentences = ["settles", "overshoot", "rise", "response", "between", "exclusive", "dwell", "ramp", "order"]
    found = {a.template: a for s in sentences for a in advised_templates(s, INFO)}
    assert found.keys() == set(TEMPLATES)
    numbers = {"REFERENCE": "8", "PER_SECOND": "2", "SECONDS": "1", "LOW": "0", "HIGH": "9", "LEVEL": "3"}
    for one in found.values():
        text = one.section
        for word, number in numbers.items():
            text = text.replace(word, number)
        spec = parse_spec(tomllib.loads(f'[model]\nfmu = "a.fmu"\n{text}'), file="my.toml")
        assert spec.requirements["NAME"].expanded(50.0)


def test_signals_are_found_by_names_and_descriptions() -> None:
    assert mentioned_signals("engine turns and speed of it, engine rpm", INFO) == ["engineRpm", "speed"]
    assert mentioned_signals("nothing of it", INFO) == []
    assert advised_templates("How nice.", INFO) == []


def test_signals_are_found_by_their_whole_names() -> None:
    cars = ModelInfo("cars", variables=tuple(Variable(f"y{k}", causality="output") for k in range(1, 6)))
    assert mentioned_signals("y5 - y4 stays below 40.", cars) == ["y4", "y5"]


@pytest.mark.parametrize(
    ("sentence", "beyond"),
    [
        ("the speed settles 3 s after each step", True),
        ("the rate of speed is at most 3 per second", True),
        ("the average power is below 3", True),
        ("the speed reaches 80 in 10 s", False),
        ("whenever the brake is on, the speed falls within 3 s", False),
    ],
)
def test_what_formulas_cannot_say_is_hinted_at(sentence: str, *, beyond: bool) -> None:
    assert bool(hint(sentence)) is beyond
