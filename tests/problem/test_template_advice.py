import tomllib

import pytest

from falsifier.core.model import ModelInfo, Variable
from falsifier.problem.spec import parse_spec
from falsifier.problem.template_advice import advised_template
from falsifier.problem.templates import TEMPLATES

MODEL = ModelInfo(
    "car",
    variables=(
        Variable("speed", causality="output", unit="mph", description="Speed of the car"),
        Variable("engineRpm", causality="output", unit="rev/min"),
        Variable("position", causality="output", unit="m"),
        Variable("slip", causality="output", unit="%"),
        Variable("y4", causality="output"),
        Variable("y5", causality="output"),
        Variable("target", causality="input", unit="m"),
        Variable("brake", causality="input"),
    ),
)
# What the best template says beside its signal. Every number of the sentence is in it, in the model's unit.
FILLED = {
    "The overshoot of the speed is at most 5 %.": "overshoot: reference = REFERENCE, at_most = '5%'",
    "The speed overshoots 80 by at most 5 mph.": "overshoot: reference = 80, at_most = 5",
    "The position stays within 5 m of the target.": "stays_within: reference = 'target', within = 5",
    "The position is within 5 m of the target in 3 s.": "settles: reference = 'target', within = 5, time = 3",
    "The position settles to 40 within 500 ms.": ("settles: reference = 40, within = MARGIN, time = 0.5"),
    "The speed settles within 2 % of 80 in 3 s whenever the brake is pressed.": (
        "settles: reference = 80, within = '2%', time = 3, after = 'CONDITION', stays = SECONDS"
    ),
    "The speed reaches 100 km/h within 2 min.": (
        "rise: reference = 62.1371192237, reaches = '100%', time = 120"
    ),
    "The speed reaches 90 % of 80 in 10 s.": "rise: reference = 80, reaches = '90%', time = 10",
    "The speed drops to 20 within 5 s.": (
        "rise: reference = 20, reaches = '100%', time = 5, direction = 'down'"
    ),
    "The speed is between 20 and 80 MPH.": "stays_within: low = 20, high = 80",
    "The speed is between 2 and 80 in the first 10 s.": "stays_within: low = 2, high = 80, during = [0, 10]",
    "The speed is never below 20.": "stays_within: low = 20",
    "The speed is no more than 20.": "stays_within: high = 20",
    "The speed never exceeds 120 mph in the first 20 s.": "stays_within: high = 120, during = [0, 20]",
    "engineRpm is at most 4,750 U/min.": "stays_within: high = 4750",
    "engineRpm is at most 3000 1/min until 5 s.": "stays_within: high = 3000, during = [0, 5]",
    "engineRpm is at least 600 rpm from 5 to 10 s.": "stays_within: low = 600, during = [5, 10]",
    "The slip is at most 5 percent.": "stays_within: high = 5",
    "y5 - y4 stays below 40.": "stays_within: high = 40",
    "The brake is at most 5 ft.": "stays_within: high = 5",
    "The position changes by at most 60 m per minute.": (
        "ramp_limit: limit = 1, over = SECONDS, range = [LOW, HIGH]"
    ),
    "The position changes by at most 36 km/h.": "ramp_limit: limit = 10, over = SECONDS, range = [LOW, HIGH]",
    "The pump stays on for at least 5 s.": "dwell: condition = 'SIGNAL > LEVEL', at_least = 5",
    "Whenever the brake is pressed, the speed drops within 2 s.": (
        "response: when = 'brake > LEVEL', then = 'speed > LEVEL', time = 2"
    ),
    "The speed drops within 2 s whenever the brake is pressed.": (
        "response: when = 'brake > LEVEL', then = 'speed > LEVEL', time = 2"
    ),
    "The brake and the slip are never high together.": (
        "never_together: conditions = ['brake > LEVEL', 'slip > LEVEL']"
    ),
    "The speed changes only after the brake is pressed.": (
        "order: conditions = ['brake > LEVEL', 'speed > LEVEL']"
    ),
}


@pytest.mark.parametrize("sentence", FILLED)
def test_numbers_are_in_their_places_and_in_the_unit_of_the_model(sentence: str) -> None:
    best = advised_template(sentence, MODEL)
    assert best is not None
    lines = best.section.replace('"', "'").splitlines()[2:]
    said = [line for line in lines if not line.startswith("signal = ")]
    assert f"{best.template}: {', '.join(said)}" == FILLED[sentence]


@pytest.mark.parametrize(
    "sentence",
    [
        "The speed stays within 5 m of the target.",  # of another kind than the speed
        "The speed is at most 50 m.",
        "The brake is at most 5 %.",  # 5 or 0.05?
        "The brake is at most 5 mostly.",
        "The speed is between 20 and 10.",
        "The speed exceeds 120.",  # not a limit
        "The speed is below 20 in 3 s.",
        "If the gate is open, the speed stays below 20.",
        "Whenever the brake exceeds 10, the speed drops below 20 within 2 s.",
        "The speed is below 0,5.",
        "The 2nd speed is below 20.",
        "The average speed is below 20.",
        "The speed settles within 2 m of 8 in 3 s after each step of 5.",
        "Die Geschwindigkeit bleibt unter 120.",
        "La vitesse reste en dessous de 120 km/h.",
    ],
)
def test_what_has_no_place_for_a_number_or_a_word_is_not_proposed(sentence: str) -> None:
    assert advised_template(sentence, MODEL) is None


def test_every_template_has_a_section_that_can_be_filled_in() -> None:
    found = {a.template: a.section for sentence in FILLED if (a := advised_template(sentence, MODEL))}
    assert found.keys() == set(TEMPLATES)
    numbers = {"REFERENCE": "8", "MARGIN": "1", "SECONDS": "1", "CONDITION": "brake > 1"}
    numbers |= {"LOW": "0", "HIGH": "9", "LEVEL": "3"}
    for text in found.values():
        for word, number in numbers.items():
            text = text.replace(word, number)
        spec = parse_spec(tomllib.loads(f'[model]\nfmu = "a.fmu"\n{text}'), file="my.toml")
        assert spec.requirements["NAME"].expanded(500.0)


@pytest.mark.parametrize(
    ("words", "signal"),
    [("The car", "speed"), ("engine turns", "engineRpm"), ("y4", "y4"), ("Nothing of it", "SIGNAL")],
)
def test_signals_are_found_by_names_and_descriptions(words: str, signal: str) -> None:
    advice = advised_template(f"{words} is at most 3.", MODEL)
    assert advice is not None and f'signal = "{signal}"' in advice.section
