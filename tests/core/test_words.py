from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import InputRange, ParameterRange, SearchSpace
from falsifier.core.words import candidate_lines, choices, in_one_line, signal_text

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
