import re
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


SENTENCES = {
    "settles": "The speed settles within 2 % of the reference at most 3 s after each step.",
    "overshoot": "The overshoot of the speed is at most 10 %.",
    "rise": "The speed reaches 80 in 10 s.",
    "response": "Whenever the brake is pressed, the speed drops within 2 s.",
    "stays_within": "The speed stays between 20 and 80.",
    "never_together": "Heating and cooling are never on together.",
    "dwell": "The pump stays on for at least 5 s.",
    "ramp_limit": "The valve moves by no more than 10 % per second.",
    "order": "The gate opens only after the lock is released.",
}


@pytest.mark.parametrize(("template", "sentence"), SENTENCES.items())
def test_words_of_a_sentence_point_to_a_template(template: str, sentence: str) -> None:
    assert advised_templates(sentence, INFO)[0].template == template


@pytest.mark.parametrize("sentence", ["The gear changes.", "Die Geschwindigkeit bleibt unter 120.", ""])
def test_a_sentence_without_such_words_has_no_template(sentence: str) -> None:
    assert advised_templates(sentence, INFO) == []


def test_what_is_not_known_is_left_in_capital_letters() -> None:
    (rise, response) = advised_templates(
        "When the brake is pressed, the speed rises to 80 within 10 s.", INFO
    )
    assert (rise.section, response.template) == (
        '[requirements.NAME]\ntemplate = "rise"\nsignal = "speed"\nreference = REFERENCE\n'
        'reaches = "100%"\ntime = SECONDS\nafter = "CONDITION"',
        "response",
    )
    assert not re.search(r"80|10\b", rise.section + response.section)


def test_what_is_filled_in_is_a_valid_spec() -> None:
    values = {"SIGNAL": '"speed"', "REFERENCE": "80", "MARGIN": '"5%"', "PER_SECOND": "5", "SECONDS": "2",
              "LOW": "0", "HIGH": "90", "CONDITION": "speed > 3", "NAME": "R"}  # fmt: skip
    for sentence in SENTENCES.values():
        for text in (sentence, f"{sentence} whenever it is on"):
            for advice in advised_templates(text, INFO, most=9):
                filled = advice.section
                for name, value in values.items():
                    filled = re.sub(rf"\b{name}\b", value, filled)
                parse_spec(tomllib.loads(f'[model]\nfmu = "a.fmu"\n{filled}'), file="a.toml")
    assert set(SENTENCES) == set(TEMPLATES)


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
