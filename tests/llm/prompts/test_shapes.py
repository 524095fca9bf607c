import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.llm.prompts.shapes import Course, breakpoints, course, oscillations, turning_points

TIMES = np.linspace(0.0, 10.0, 1001)
FAST = 2 * np.sin(2 * np.pi * 5 * TIMES)


def redrawn(drawn: Course) -> NDArray[np.float64]:
    (points,) = drawn.lines
    return np.asarray(np.interp(TIMES, *np.array(points).T))


@pytest.mark.parametrize(
    "column", [np.sin(TIMES), TIMES**2, np.where(TIMES < 3, 1.0, 5.0), np.exp(-TIMES), 0 * TIMES]
)
def test_straight_lines_between_breakpoints_stay_within_the_tolerance(column: NDArray[np.float64]) -> None:
    drawn = course(TIMES, column, tolerance=0.02 * float(np.ptp(column)), slower_than=0.5)
    assert np.abs(redrawn(drawn) - column).max() <= 0.02 * np.ptp(column) + 1e-12
    assert drawn.swings == ()


def test_a_jump_needs_two_breakpoints_and_a_line_none() -> None:
    chosen, error = breakpoints(TIMES, np.where(TIMES < 3.005, 1.0, 5.0), tolerance=0.01)
    assert (chosen, error) == ([0, 300, 301, 1000], 0.0)
    assert breakpoints(TIMES, 3 * TIMES, tolerance=1e-9)[0] == [0, 1000]


def test_a_limited_number_goes_where_the_signal_bends_most() -> None:
    bump = np.exp(-(((TIMES - 7) / 0.1) ** 2))
    chosen, error = breakpoints(TIMES, bump, tolerance=1e-6, most=8)
    assert len(chosen) == 8
    assert error < 0.2
    assert all(6.5 < TIMES[k] < 7.5 for k in chosen[1:-1])


def test_a_breakpoint_is_kept_where_it_is_wanted() -> None:
    (points,) = course(TIMES, TIMES, tolerance=0.1, slower_than=0.5, kept=(4.0, 20.0)).lines
    assert points == ((0.0, 0.0), (4.0, 4.0), (10.0, 10.0))


def test_a_fast_oscillation_is_found_where_it_is() -> None:
    column = np.where((TIMES > 3) & (TIMES < 6), FAST, 0.0) + TIMES
    (swing,) = oscillations(TIMES, column, slower_than=0.5)
    assert (swing.start, swing.end) == pytest.approx((3.0, 6.0), abs=0.2)
    assert [phase.period for phase in swing.phases] == pytest.approx([0.2], rel=0.05)
    for points, side in ((swing.lower, -2.0), (swing.upper, 2.0)):
        middle = np.interp(4.5, *np.array(points).T)
        assert middle == pytest.approx(4.5 + side, abs=0.3), "the envelope rises with the signal"


def test_phases_of_an_oscillation_have_their_own_period() -> None:
    slow = 2 * np.sin(2 * np.pi * 2 * TIMES)
    (swing,) = oscillations(TIMES, np.where(TIMES < 6, slow, FAST), slower_than=1.0)
    assert [phase.period for phase in swing.phases] == pytest.approx([0.5, 0.2], rel=0.1)
    assert swing.phases[1].start == pytest.approx(6.0, abs=0.5)
    assert swing.period_at(1.0) == pytest.approx(0.5, rel=0.1)
    assert swing.period_at(9.0) == pytest.approx(0.2, rel=0.1)


def test_slow_signals_and_ripple_do_not_oscillate() -> None:
    assert oscillations(TIMES, np.sin(2 * np.pi * TIMES / 5), slower_than=0.5) == []
    assert oscillations(TIMES, 100 * TIMES + 0.1 * np.sin(60 * TIMES), slower_than=0.5) == []


def test_a_rise_with_ripple_is_no_oscillation() -> None:
    rise = TIMES + 0.15 * np.sin(2 * np.pi * TIMES / 0.5)
    assert oscillations(TIMES, rise, slower_than=2.0) == []
    high_low_high = np.interp(TIMES, [0, 2, 4, 4.1, 4.2, 6, 8, 10], [0, 5, 0, 0.05, 0, 5, 0, 0])
    assert [round(float(TIMES[k])) for k in turning_points(high_low_high)] == [2, 4, 6]


def test_slow_swings_are_told_as_such_if_points_between_fast_ones_do_not_suffice() -> None:
    swinging = np.sin(2 * np.pi * TIMES) + np.where((TIMES > 4) & (TIMES < 5), FAST, 0)
    drawn = course(TIMES, swinging, tolerance=0.05, slower_than=0.5, most=12)
    (swing,) = drawn.swings
    assert swing.end - swing.start > 9
    assert drawn.tolerance <= 0.05


def test_lines_and_oscillations_take_turns() -> None:
    column = np.where((TIMES > 3) & (TIMES < 6), FAST, 0.0)
    drawn = course(TIMES, column, tolerance=0.08, slower_than=0.5)
    assert len(drawn.swings) == 1
    before, after = drawn.lines
    assert before[0][0] == 0.0 and before[-1][0] == pytest.approx(3.0, abs=0.2)
    assert after[0][0] == pytest.approx(6.0, abs=0.2) and after[-1][0] == 10.0


def test_envelopes_ignore_where_samples_fall_between_peaks() -> None:
    # Seven samples per period of a triangle: sampled peaks differ by the place of the samples alone.
    times = np.arange(0, 100, 0.01)
    column = 10 + 5 * np.abs((times / 0.0733) % 1.0 - 0.5) * 2
    (swing,) = oscillations(times, column, slower_than=5.0)
    assert len(swing.lower) == len(swing.upper) == 2
