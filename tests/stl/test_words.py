import random

import pytest

from falsifier.stl import in_words, parse
from tests.stl.randoms import random_formula


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("G[0,1234567.8] (x > 1)", "At all times from 0 to 1234567.8 s, x is above 1."),
        ("G[0.1234567,0.1234568] b", "At all times from 0.1234567 to 0.1234568 s, b is true."),
        ("G F (x >= 1)", "At all times, at some time from then on, x is at least 1."),
        ("F G b", "At some time, from then on, b is true."),
        ("G[4,4] (not b)", "At 4 s, b is false."),
        ("3 >= x", "x is at most 3."),
        ("1 <= x <= 3", "x is between 1 and 3."),
        ("abs(gear - 1) <= 0.5", "gear is within 0.5 of 1."),
        ("abs(gear - 1) < 0.5", "gear differs from 1 by less than 0.5."),
        ("abs(gear - 1) > 0.5", "gear differs from 1 by more than 0.5."),
        (
            "G[0,65] F[0,30] G[0,5] (y5 - y4 >= 8)",
            "At all times from 0 to 65 s, at some time within the next 30 s, throughout the next 5 s, "
            "y5 - y4 is at least 8.",
        ),
        (
            "(G[0,30] (rpm <= 3000)) -> (G[0,4] (speed <= 35))",
            "If at all times from 0 to 30 s, rpm is at most 3000, "
            "then at all times from 0 to 4 s, speed is at most 35.",
        ),
        (
            "(speed >= 10) U[5,30] (rpm >= 3400)",
            "speed is at least 10 until, at some time from 5 to 30 s, rpm is at least 3400.",
        ),
        (
            "G[0,9] (a and X not a -> F[1,2] b)",
            "At all times from 0 to 9 s, if a is true and (at the next recorded time, a is false), "
            "then at some time from 1 to 2 s later, b is true.",
        ),
        ("(a or b) and c <-> d", "((a is true or b is true) and c is true) exactly when d is true."),
        ("not (a and b)", "It is not the case that (a is true and b is true)."),
    ],
)
def test_formulas_read_aloud(text: str, words: str) -> None:
    assert in_words(parse(text)) == words


def test_every_formula_is_one_sentence_that_names_its_signals() -> None:
    for seed in range(300):
        formula = random_formula(random.Random(seed), 4)
        words = in_words(formula)
        assert words.endswith(".") and "\n" not in words
        assert all(name in words for name in formula.signals)
