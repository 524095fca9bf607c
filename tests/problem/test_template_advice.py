import tomllib

import pytest

from falsifier.core.model import ModelInfo, Variable
from falsifier.problem.sentence import mentioned_signals
from falsifier.problem.spec import parse_spec
from falsifier.problem.template_advice import advised_templates, hint
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
        ("Heating and cooling are never on together.", "never_together"),
        ("The valve moves by no more than 10 % per second.", "ramp_limit"),
        ("The gate opens only after the lock is released.", "order"),
    ],
)
def test_words_of_a_sentence_point_to_a_template(sentence: str, template: str) -> None:
    assert advised_templates(sentence, INFO)[0].template == template


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
    "The speed settles at 60, give or take 3, for 5 s.": (
        "settles: reference = 60, within = 3, time = SECONDS, stays = 5"
    ),
    "The speed reaches 100 km/h within 2 min.": (
        "rise: reference = 62.1371192237, reaches = '100%', time = 120"
    ),
    "The speed reaches 90 % of 80 in 10 s.": "rise: reference = 80, reaches = '90%', time = 10",
    "The speed drops to 20 within 5 s.": (
        "rise: reference = 20, reaches = '100%', time = 5, direction = 'down'"
    ),
    "The speed is between 20 and 80 MPH.": "stays_within: low = 20, high = 80",
    "The speed must not exceed 120 or fall below 20.": "stays_within: high = 120, low = 20",
    "The speed is never below 20.": "stays_within: low = 20",
    "The speed is no more than 20.": "stays_within: high = 20",
    "The speed never exceeds 120 mph in the first 20 s.": "stays_within: high = 120, during = [0, 20]",
    "engineRpm is at most 4,750 U/min.": "stays_within: high = 4750",
    "engineRpm is at most 3000 1/min after 5 s.": "stays_within: high = 3000, during = [5, END]",
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
    "The speed changes only after the brake is pressed.": (
        "order: conditions = ['brake > LEVEL', 'speed > LEVEL']"
    ),
}


@pytest.mark.parametrize("sentence", FILLED)
def test_numbers_are_in_their_places_and_in_the_unit_of_the_model(sentence: str) -> None:
    best = advised_templates(sentence, MODEL)[0]
    lines = best.section.replace('"', "'").splitlines()[2:]
    said = [line for line in lines if not line.startswith("signal = ")]
    assert f"{best.template}: {', '.join(said)}" == FILLED[sentence]


@pytest.mark.parametrize(
    "sentence",
    [
        "The speed stays within 5 m of the target.",  # of another kind than the speed
        "The speed is at most 50 m.",
        "The brake is at most 5 %.",  # 5 or 0.05?
        "The speed exceeds 120.",  # not a limit
        "The speed is below 20 in 3 s.",
        "If the gate is open, the speed stays below 20.",
        "Whenever the brake exceeds 10, the speed drops below 20 within 2 s.",
        "The speed is below 0,5.",
        "The 2nd speed is below 20.",
        "The speed is between 80 and 20.",
        "Die Geschwindigkeit bleibt unter 120.",
        "La vitesse reste en dessous de 120 km/h.",
    ],
)
def test_a_template_without_a_place_for_a_number_is_not_proposed(sentence: str) -> None:
    assert advised_templates(sentence, MODEL) == []


def test_every_template_has_a_section_that_can_be_filled_in() -> None:
    sentences = ["settles", "overshoot", "rise", "response", "between", "exclusive", "dwell", "ramp", "order"]
    found = {a.template: a for s in sentences for a in advised_templates(s, INFO)}
    assert found.keys() == set(TEMPLATES)
    numbers = {"REFERENCE": "8", "MARGIN": "1", "PER_SECOND": "2", "SECONDS": "1"}
    numbers |= {"LOW": "0", "HIGH": "9", "LEVEL": "3"}
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
