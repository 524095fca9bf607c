import pytest

from falsifier.context.crossings import Definitions, crossings_of
from falsifier.context.thresholds import thresholds

RANGES = {"plant.u": (0.0, 10.0)}


def found(text: str, known: Definitions = Definitions(), **constants: str) -> list[float]:  # noqa: B008
    return [
        crossing.value for crossing in crossings_of(thresholds([(text, 1)], constants, "a.mo"), known, RANGES)
    ]


@pytest.mark.parametrize(
    ("text", "crossings"),
    [
        ("u > 9.5", [9.5]),
        ("9.5 < u and u < 9.75", [9.5, 9.75]),
        ("2 * u - 1 > 5", [3.0]),
        ("abs(u - 3) < 0.5", [2.5, 3.5]),
        ("u * u > 4", [2.0]),
        ("m->u > 1e-3f * 500", [0.5]),
        ("u > 0x0A - 0x2u", [8.0]),
        ("u > 0x1.8p1", [3.0]),
        ("u > 0x" + 300 * "F", []),
        ("u > 1e999", []),
        ("pre(u) >= max(2, 3)", [3.0]),
        ("u > 12", []),
        ("u > other", []),
        ("f(u) > 3", []),
        ("u / 0 > 3", []),
        ("(u > 3", [3.0]),
    ],
)
def test_comparisons_are_solved_for_the_signal(text: str, crossings: list[float]) -> None:
    assert found(text) == pytest.approx(crossings)


def test_a_constant_with_two_values_gives_two_levels() -> None:
    assert found("u > limit", limit="5 or 9") == [5.0, 9.0]
    assert found("u > limit", limit="5 or something") == [5.0]


def test_variables_are_followed_to_the_signal() -> None:
    known = Definitions({"e": "2 * d", "d": "wanted - u", "loop": "loop + 1"}, {"x": frozenset({"u", "x"})})
    assert found("e > 4", known, wanted="9") == []  # a constant of the comparison itself only
    known = Definitions({"e": "2 * d", "d": "9 - u", "loop": "loop + 1"}, {"x": frozenset({"u", "x"})})
    assert found("e > 4", known) == [7.0]
    assert found("x > 4", known) == [4.0]  # a state follows its input
    assert found("loop > 4", known) == []


def test_states_that_feed_each_other_take_no_time_that_grows_with_a_power_of_their_number() -> None:
    states = [f"x{i}" for i in range(4)]
    equal = {state: f"({' + '.join(states)}) / 8 + u / 2" for state in states}
    fed = dict.fromkeys(states, frozenset((*states, "u")))
    assert found("x0 > 4", Definitions(equal, fed)) == [4.0]  # once per path of 12 steps is 4 ** 12 times


def test_the_number_of_levels_is_limited() -> None:
    assert len(found(" and ".join(f"u > {i / 10}" for i in range(1, 90)))) == 24
