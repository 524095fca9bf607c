"""Inputs and numbers as prompts write them."""

from dataclasses import replace

from hypothesis import given, strategies as st

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.llm.prompts.numbers import as_signals, bounds, signal_text
from falsifier.llm.prompts.published import as_point, as_values
from falsifier.llm.prompts.view import View
from falsifier.testing import FREE, START, lag_problem

PROBLEM = lag_problem(inputs=2, free=FREE, parameters=[START])
VIEW = View.of(PROBLEM)
FIXED = PROBLEM.space.decode([0, 0.5, 0.5, 1, -1, -1, -1, -1, 0.25])
STEP = PROBLEM.space.admit(
    Candidate(
        {"u": Signal((0.0, 4.0), (0.0, 1.0), "constant"), "v": Signal((0.0,), (-1.0,), "pchip")}, {"x0": 0.25}
    )
)


def test_points_and_values_are_read_at_the_fixed_times() -> None:
    assert as_point(VIEW, FIXED) == ("point = [0, 0.5, 0.5, 1, -1, -1, -1, -1, 0.25]",)
    assert as_values(VIEW, FIXED) == ("u = [0, 0.5, 0.5, 1]", "v = [-1, -1, -1, -1]", "x0 = 0.25")
    # Control points at 0, 3.33, 6.67 and 10 s; the step is at 4 s.
    read = "(values at these times of an input with other control points)"
    assert as_values(VIEW, STEP)[:2] == (f"u = [0, 0, 1, 1] {read}", "v = [-1, -1, -1, -1]")
    assert as_point(VIEW, STEP)[0].endswith(read)


REST = ("v: constant -1", "x0 = 0.25")


def test_signals_are_told_with_their_own_control_points() -> None:
    assert as_signals(VIEW, FIXED)[0] == "u: linear, 4 evenly spaced values [0, 0.5, 0.5, 1]"
    assert as_signals(VIEW, STEP) == (
        "u: constant pieces from [time, value] points [[0, 0], [4, 1]]",
        *REST,
    )


def test_inputs_that_do_the_same_are_told_together() -> None:
    constant = Signal((0.0,), (-0.5,), "constant")
    alike = as_signals(VIEW, Candidate({"u": constant, "v": constant}, {"x0": 0.25}))
    assert alike == ("u, v: constant -0.5", "x0 = 0.25")


def test_values_with_few_digits_more_than_usual_are_told_as_they_are() -> None:
    given = Candidate(
        {n: Signal((0.0,), (v,), "constant") for n, v in (("u", 0.032125), ("v", 1 / 3))}, {"x0": 0.1234567}
    )
    assert as_signals(VIEW, given) == ("u: constant 0.032125", "v: constant 0.333", "x0 = 0.1234567")
    assert as_signals(VIEW, replace(given, parameters={"x0": 1 / 3}))[-1] == "x0 = 0.3333"


def test_in_brief_a_signal_of_many_pieces_is_only_described() -> None:
    times = [0.0, 2.5, *(2.5 + 0.25 * k for k in range(1, 30))]
    signal = Signal(tuple(times), tuple(float(k % 2) for k in range(31)), "constant")
    made = Candidate({"u": signal, "v": Signal((0.0,), (-1.0,), "pchip")}, {"x0": 0.25})
    assert as_signals(VIEW, made, in_brief=True) == (
        "u: 31 constant pieces between 0 and 1, mean 0.375, each 0.25 to 2.5 s long, 0.25 s in the median",
        *REST,
    )
    wavy = replace(signal, values=tuple(float(k % 2) or 0.03 * (k % 4) / 2 - 0.03 for k in range(31)))
    (first, *_) = as_signals(VIEW, replace(made, signals={**made.signals, "u": wavy}), in_brief=True)
    assert "31 constant pieces between -0.03 and 1, mean " in first, "whatever of it is merged"
    assert as_signals(VIEW, STEP, in_brief=True) == as_signals(VIEW, STEP)
    assert "[[0, 0], [2.5, 1], [2.75, 0]" in as_signals(VIEW, made)[0]


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_printed_bounds_lie_inside_the_range(low: float, width: float) -> None:
    for digits in (7, 10):
        if low < low + width:
            printed_low, printed_high = (float(text) for text in bounds(low, low + width, digits))
            assert low <= printed_low <= printed_high <= low + width


def test_values_of_a_narrow_range_are_told_apart() -> None:
    assert bounds(1000000.0001, 1000000.0009, 7) == ("1000000.0001", "1000000.0009")
    signal = Signal((0.0, 4.0), (1e12 + 0.25, 1e12), "constant")
    assert signal_text(signal, stop_time=10.0).endswith("[[0, 1000000000000.25], [4, 1000000000000]]")
    assert (
        signal_text(replace(signal, values=(1e12 + 0.25,) * 2), stop_time=10.0) == "constant 1000000000000.25"
    )
