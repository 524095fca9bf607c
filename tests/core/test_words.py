import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import InputRange, ParameterRange, SearchSpace
from falsifier.core.words import candidate_lines, choices, counted, in_one_line, listed, signal_text

SPACE = SearchSpace((InputRange("u", 0, 1, unit="V"),), (ParameterRange("mass", 0, 9, unit="kg"),), 10.0)
CANDIDATE = Candidate({"u": Signal((0.0, 2.0), (0.25, 1.0), "linear")}, {"mass": 1 / 3})


def test_inputs_come_first_with_the_units_of_the_space() -> None:
    found = [(c.role, c.label, c.text) for c in choices(CANDIDATE, SPACE)]
    assert found == [
        ("input", "u [V]", "linear: 0.25 at 0 s, 1 at 2 s (1 switch)"),
        ("parameter", "mass [kg]", "0.3333333333"),
    ]
    assert [c.label for c in choices(CANDIDATE)] == ["u", "mass"], "without a space no unit is known"


def test_lines_are_aligned_and_one_line_has_it_all() -> None:
    first, second = candidate_lines(CANDIDATE, SPACE)
    assert first.index("u [V]") == second.index("mass [kg] = 0.3333333333")
    assert in_one_line(CANDIDATE, SPACE) == (
        "u [V] linear: 0.25 at 0 s, 1 at 2 s (1 switch); mass [kg] = 0.3333333333"
    )
    assert in_one_line(Candidate()) == ""


def test_a_long_signal_is_cut_in_the_middle_and_says_how_lively_it_is() -> None:
    times = tuple(0.5 * i for i in range(40))
    text = signal_text(Signal(times, tuple(float(i % 2) for i in range(40)), "constant"))
    assert text.startswith("constant: 0 at 0 s, 1 at 0.5 s")
    assert "... 28 more ..." in text
    assert text.endswith("1 at 19.5 s (39 switches, shortest dwell 0.5 s)")


def test_equal_values_are_a_constant_whatever_the_points() -> None:
    assert signal_text(Signal((0.0, 1.0, 2.0), (3.0, 3.0, 3.0), "pchip")) == "constant 3"


@pytest.mark.parametrize(
    ("count", "noun", "text"),
    [(1, "switch", "1 switch"), (0, "box", "0 boxes"), (2, "run", "2 runs"), (3, "class", "3 classes")],
)
def test_counted_things_are_in_the_singular_or_plural(count: int, noun: str, text: str) -> None:
    assert counted(count, noun) == text


def test_several_things_are_joined_as_in_a_sentence() -> None:
    assert [listed(parts) for parts in (["a"], ["a", "b"], ["a", "b", "c"])] == ["a", "a and b", "a, b and c"]
