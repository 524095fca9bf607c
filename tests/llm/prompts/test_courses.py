"""Signals over time in words; what is stated of their accuracy is computed here from the text."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.prompts import samples, told_courses
from falsifier.llm.prompts.courses import (
    Course,
    Swing,
    breakpoints,
    change_list,
    coarse_clock,
    column_decimals,
    course,
    dwell_list,
    longest_stretch,
    oscillations,
    pieces,
    turning_points,
)
from falsifier.llm.prompts.view import View
from falsifier.problem.loading import load_problem

TIMES = np.linspace(0.0, 10.0, 1001)
FAST = 2 * np.sin(2 * np.pi * 5 * TIMES)


def steps(*pairs: tuple[float, float]) -> NDArray[np.float64]:
    """Column that takes each value from each time on."""
    column = np.zeros_like(TIMES)
    for start, value in pairs:
        column[np.round(TIMES, 9) >= start] = value
    return column


GEAR = steps((0, 1), (1.6, 2), (4.36, 3), (5.0, 2), (5.25, 1), (7.0, 4))


def test_change_list() -> None:
    assert (
        change_list(TIMES, GEAR, clock=2)
        == "1, then 2 from 1.6 s, 3 from 4.36 s, 2 from 5 s, 1 from 5.25 s, 4 from 7 s"
    )
    assert change_list(TIMES, np.full_like(TIMES, 3.0), clock=2) == "constant 3"


def test_long_change_lists_are_cut_in_the_middle() -> None:
    text = change_list(TIMES, (np.arange(1001) // 10 % 2).astype(np.float64), clock=2)
    assert "85 more changes" in text
    assert text.startswith("0, then 1 from 0.1 s")
    assert text.endswith("from 10 s")


def test_dwell_list_names_the_shortest_stay_after_an_entry() -> None:
    stays = dwell_list(TIMES, GEAR, clock=2).split("; ")
    assert stays == [
        "1: entered once, shortest stay 1.75 s from 5.25 s",
        "2: entered 2 times, shortest stay 0.25 s from 5 s",
        "3: entered once, shortest stay 0.64 s from 4.36 s",
        "4: entered at 7 s and still held at 10 s",
    ]
    assert "1: never entered again" in dwell_list(TIMES, steps((0, 1), (2, 2)), clock=2)


def test_pieces_cover_everything() -> None:
    found = pieces(TIMES, GEAR)
    assert [p.value for p in found] == [1, 2, 3, 2, 1, 4]
    assert found[0].start == 0 and found[-1].end == 10
    assert all(a.end == b.start for a, b in pairwise(found))


def test_longest_stretch() -> None:
    assert longest_stretch(TIMES, GEAR == 2) == pytest.approx((1.6, 4.35))
    assert longest_stretch(TIMES, GEAR == 7) is None
    assert longest_stretch(TIMES, GEAR > 0) == (0, 10)


@pytest.mark.parametrize("name", ["AT1", "AT51", "CC4", "NN", "SC", "F16", "PulseMeter"])
def test_no_course_is_further_off_than_the_prompt_says(name: str) -> None:
    problem = load_problem(name)
    evaluations = [e for e in samples(problem, 4) if e.trajectory is not None and e.verdict is not None]
    told = [one for e in evaluations for one in told_courses(View.of(problem), e)]
    problem.model.close()
    assert len(told) > len(evaluations)
    assert [one for one in told if one.error > one.stated * (1 + 1e-6)] == []


def test_a_course_that_needs_more_points_says_how_exact_it_is() -> None:
    wild = np.cumsum(np.random.default_rng(0).normal(size=len(TIMES)))
    drawn = course(TIMES, wild, tolerance=0.02 * float(np.ptp(wild)), slower_than=0.5, most=6)
    assert drawn.error > drawn.claimed
    within = float(drawn.text(clock=2).rpartition("within ")[2].rstrip(")"))
    assert drawn.error <= within <= 1.1 * drawn.error


def test_near_a_threshold_points_are_finer_once_the_rest_is_exact_enough() -> None:
    wave = np.sin(TIMES)
    fine = np.where(TIMES > 6, 0.012, 0.1)
    drawn = course(TIMES, wave, tolerance=fine, slower_than=0.5)
    (points,) = drawn.lines
    error = np.abs(np.interp(TIMES, *np.array(points).T[:2]) - wave)
    assert error.max() <= 0.1 and error[TIMES > 6].max() <= 0.012 < error[TIMES < 6].max()


@pytest.mark.parametrize(
    "column", [np.sin(TIMES), TIMES**2, np.where(TIMES < 3, 1.0, 5.0), np.exp(-TIMES), 0 * TIMES]
)
def test_straight_lines_between_breakpoints_stay_within_the_tolerance(column: NDArray[np.float64]) -> None:
    drawn = course(TIMES, column, tolerance=0.02 * float(np.ptp(column)), slower_than=0.5)
    (points,) = drawn.lines
    error = np.abs(np.interp(TIMES, *np.array(points).T[:2]) - column)
    assert error.max() <= 0.02 * np.ptp(column) + 1e-12
    assert drawn.swings == () and "within" not in drawn.text(clock=2)


def test_a_jump_needs_two_breakpoints_and_a_line_none() -> None:
    assert breakpoints(TIMES, np.where(TIMES < 3.005, 1.0, 5.0), tolerance=0.01) == [0, 300, 301, 1000]
    assert breakpoints(TIMES, 3 * TIMES, tolerance=1e-9) == [0, 1000]


def test_a_limited_number_goes_where_the_signal_bends_most() -> None:
    chosen = breakpoints(TIMES, np.exp(-(((TIMES - 7) / 0.1) ** 2)), tolerance=1e-6, most=8)
    assert len(chosen) == 8
    assert all(6.5 < TIMES[k] < 7.5 for k in chosen[1:-1])


def test_a_breakpoint_is_kept_where_it_is_wanted() -> None:
    (points,) = course(TIMES, TIMES, tolerance=0.1, slower_than=0.5, kept=(4.0, 20.0)).lines
    assert [(t, v) for t, v, _ in points] == [(0.0, 0.0), (4.0, 4.0), (10.0, 10.0)]


def test_a_fast_oscillation_is_found_where_it_is() -> None:
    column = np.where((TIMES > 3) & (TIMES < 6), FAST, 0.0) + TIMES
    (swing,) = oscillations(TIMES, column, slower_than=0.5)
    assert (swing.start, swing.end) == pytest.approx((3.0, 6.0), abs=0.2)
    assert swing.periods == pytest.approx((0.2, 0.2), rel=0.05)
    for points, side in ((swing.lower, -2.0), (swing.upper, 2.0)):
        middle = np.interp(4.5, *np.array(points).T[:2])
        assert middle == pytest.approx(4.5 + side, abs=0.3), "the envelope rises with the signal"


def test_a_period_that_changes_is_told_at_both_ends() -> None:
    slow = 2 * np.sin(2 * np.pi * 2 * TIMES)
    (swing,) = oscillations(TIMES, np.where(TIMES < 6, slow, FAST), slower_than=1.0)
    assert swing.periods == pytest.approx((0.5, 0.2), rel=0.1)
    text = Course((), (swing,), 0.0, 0.0, 1.0).text(clock=1)
    assert "with period 0.5 s, at the end 0.2 s, between" in text


def test_slow_signals_and_ripple_do_not_oscillate() -> None:
    assert oscillations(TIMES, np.sin(2 * np.pi * TIMES / 5), slower_than=0.5) == []
    assert oscillations(TIMES, 100 * TIMES + 0.1 * np.sin(60 * TIMES), slower_than=0.5) == []
    rise = TIMES + 0.15 * np.sin(2 * np.pi * TIMES / 0.5)
    assert oscillations(TIMES, rise, slower_than=2.0) == []
    high_low_high = np.interp(TIMES, [0, 2, 4, 4.1, 4.2, 6, 8, 10], [0, 5, 0, 0.05, 0, 5, 0, 0])
    turns = turning_points(high_low_high, np.full_like(TIMES, 0.1))
    assert [round(float(TIMES[k])) for k in turns] == [2, 4, 6]


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


def test_a_course_is_told_by_its_breakpoints_and_oscillations() -> None:
    flat = Course((((0.0, 1.0, 0.1), (0.04, 1.0, 0.1), (2.5, 3.04, 0.1)),), (), 0.0, 0.0, 0.1)
    assert flat.text(clock=1) == "0:1 2.5:3.04", "what reads the same is told once"
    swing = Swing(3.0, 6.0, (0.2, 0.2), ((3.0, -1.0, 1.0),), ((6.0, 1.0, 1.0),))
    drawn = Course((((0.0, 0.0, 1.0), (3.0, 0.0, 1.0)),), (swing,), 0.0, 0.0, 1.0)
    assert drawn.text(clock=0) == (
        "0:0 3:0; oscillates from 3 to 6 s with period 0.2 s, between 3:-1 and 6:1"
    )
    close = Course((((0.0, 1.0, 1.0), (0.11, 2.0, 1.0), (0.12, 3.0, 1.0)),), (), 0.0, 0.0, 1.0)
    assert close.text(clock=1) == "0:1 0.11:2 0.12:3", "two breakpoints never have the same time"


def test_digits_follow_the_margin() -> None:
    pressure = np.array([87.0, 87.463, 90.0])
    assert column_decimals(pressure) == 2
    assert column_decimals(pressure, margin=0.037) == 4
    assert column_decimals(pressure, margin=1e-30) <= 8


def test_times_of_a_course_show_a_hundredth_of_the_simulation() -> None:
    assert [coarse_clock(stop) for stop in (1000.0, 50.0, 3.0, 0.3)] == [0, 1, 2, 3]
