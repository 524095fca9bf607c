import pytest

from falsifier.context.crossings import crossings_of
from falsifier.context.thresholds import thresholds

RANGES = {"plant.u": (0.0, 10.0)}


def found(text: str, **constants: str) -> list[float]:
    return [crossing.value for crossing in crossings_of(thresholds(text, constants, "a.mo"), RANGES)]


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
    assert found("u > limit", limit="2 * half", half="3") == []  # a constant of the comparison itself only


def test_the_number_of_levels_is_limited() -> None:
    assert len(found(" and ".join(f"u > {i / 10}" for i in range(1, 90)))) == 24
