"""Signals over time in words; what is stated of their accuracy is computed here from the text."""

import re

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.prompts import samples, told_courses
from falsifier.llm.prompts.courses import breakpoints, change_list, course, dwell_list, oscillations
from falsifier.llm.prompts.numbers import column_decimals
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
    told = "1, then 2 from 1.6 s, 3 from 4.36 s, 2 from 5 s, 1 from 5.25 s, 4 from 7 s"
    assert change_list(TIMES, GEAR, clock=2) == told
    assert change_list(TIMES, np.full_like(TIMES, 3.0), clock=2) == "constant 3"
    for count, left_out in ((24, []), (25, ["2 more changes"])):
        squares = np.minimum(np.sqrt(np.arange(1001)) // 1, count)
        changes = change_list(TIMES, squares, clock=2).split(", ")
        assert [each for each in changes if "more" in each] == left_out
    counted = steps((0, 5), (1, 4), (2, 4.5), *((t, t + 2) for t in range(3, 9)), (9.5, 0))
    told = "5, then 4 from 1 s, 4.5 from 2 s, 5 from 3 s, by +1 every 1 s to 10 from 8 s, 0 from 9.5 s"
    assert change_list(TIMES, counted, clock=2) == told
    uneven = steps((0, 0), (1, 1), (3, 2), (4, 3), (6, 4), (7, 5), (9, 6))
    assert "every" not in change_list(TIMES * 1e-9, uneven, clock=10), "however short the times are"
    long = change_list(TIMES, (np.arange(1001) // 10 % 2).astype(np.float64), clock=2)
    assert long.startswith("0, then 1 from 0.1 s") and "77 more changes" in long and long.endswith("10 s")


def test_dwell_list_names_the_shortest_stay() -> None:
    told = "2 times at 1, the shortest for 1.6 s from 0 s; 2 times at 2, the shortest for 0.25 s from 5 s"
    assert dwell_list(TIMES, GEAR, clock=2) == told
    back_at_the_end = dwell_list(TIMES, steps((0, 1), (2, 2), (3, 1), (4, 2), (5, 1)), clock=2)
    told = "3 times at 1, the shortest for 1 s from 3 s; 2 times at 2, each for 1 s"
    assert back_at_the_end == told
    assert dwell_list(TIMES, steps((0, 1), (2, 2), (3, 3)), clock=2) == "", "the changes tell as much"
    short = dwell_list(TIMES * 1e-6, steps((0, 1), (2, 2), (3, 1)), clock=8)
    assert short == "2 times at 1, the shortest for 2e-06 s from 0 s"


@pytest.mark.parametrize("name", ["AT1", "AT51", "CC4", "NN", "SC", "F16", "PulseMeter"])
def test_no_course_is_further_off_than_the_prompt_says(name: str) -> None:
    problem = load_problem(name)
    evaluations = [e for e in samples(problem, 4) if e.trajectory is not None and e.verdict is not None]
    told = [one for e in evaluations for one in told_courses(View.of(problem), e)]
    problem.model.close()
    assert len(told) > len(evaluations)
    assert [one for one in told if one.error > one.stated * (1 + 1e-6)] == []


def drawn_points(text: str) -> tuple[list[float], list[float]]:
    pairs = [pair.split(":") for pair in text.split(" ")]
    return [float(t) for t, _ in pairs], [float(v) for _, v in pairs]


def test_a_course_that_needs_more_points_says_how_exact_it_is() -> None:
    wild = 1e6 + np.cumsum(np.random.default_rng(0).normal(size=len(TIMES)))
    claimed = 0.02 * float(np.ptp(wild))
    text = course(TIMES, wild, clock=2, tolerance=claimed, slower_than=0.0, most=6)
    points, _, within = text.removesuffix(")").partition(" (each value within ")
    within, *extremes = re.split(", |; ", within)
    lowest, highest = int(wild.argmin()), int(wild.argmax())
    assert [float(text.split()[1]) for text in extremes] == pytest.approx([wild.min(), wild.max()], abs=0.1)
    assert [float(text.split()[3]) for text in extremes] == pytest.approx(TIMES[[lowest, highest]])
    error = np.abs(np.interp(TIMES, *drawn_points(points)) - wild).max()
    assert claimed < error <= float(within) <= 2 * error


def test_of_what_is_too_irregular_the_extremes_of_equal_parts_are_told() -> None:
    wild = np.random.default_rng(0).uniform(-1, 1, len(TIMES))
    wild[[300, 700]] = -2.0, 3.0
    told = course(TIMES, wild, clock=2, tolerance=0.1, slower_than=0.5, most=3, coarsest=0.3)
    begin, end = "irregular, least to greatest in each 3.3 s: ", " (least -2 at 3 s, greatest 3 at 7 s)"
    assert told.startswith(begin) and told.endswith(end)
    spans = [
        list(map(float, span.split(" to ")))
        for span in told.removeprefix(begin).removesuffix(end).split(", ")
    ]
    parts = (wild[:334], wild[333:668], wild[667:])
    assert np.array(spans) == pytest.approx(np.array([(part.min(), part.max()) for part in parts]), abs=0.005)


def test_near_a_threshold_points_are_finer_once_the_rest_is_exact_enough() -> None:
    wave = np.sin(TIMES)
    told = course(TIMES, wave, clock=2, tolerance=np.where(TIMES > 6, 0.012, 0.1), slower_than=0.5)
    error = np.abs(np.interp(TIMES, *drawn_points(told)) - wave)
    assert error.max() <= 0.1 and error[TIMES > 6].max() <= 0.012 < error[TIMES < 6].max()


@pytest.mark.parametrize(
    "column", [np.sin(TIMES), TIMES**2, np.where(TIMES < 3, 1.0, 5.0), np.exp(-TIMES), 0 * TIMES]
)
def test_straight_lines_between_breakpoints_stay_within_the_tolerance(column: NDArray[np.float64]) -> None:
    text = course(TIMES, column, clock=2, tolerance=0.02 * float(np.ptp(column)), slower_than=0.5)
    assert "swings" not in text and "within" not in text
    error = np.abs(np.interp(TIMES, *drawn_points(text)) - column)
    assert error.max() <= 0.02 * np.ptp(column) + 1e-12


def test_points_go_where_a_signal_bends_most_and_where_they_are_wanted() -> None:
    assert breakpoints(TIMES, np.where(TIMES < 3.005, 1.0, 5.0), tolerance=0.01) == [0, 300, 301, 1000]
    assert breakpoints(TIMES, 3 * TIMES, tolerance=1e-9) == [0, 1000]
    chosen = breakpoints(TIMES, np.exp(-(((TIMES - 7) / 0.1) ** 2)), tolerance=1e-6, most=8)
    assert len(chosen) == 8 and all(6.5 < TIMES[k] < 7.5 for k in chosen[1:-1])
    kept = course(TIMES, TIMES, clock=1, tolerance=0.1, slower_than=0.5, kept=(4.0, 20.0))
    assert kept == "0:0 4:4 10:10"


def test_a_fast_oscillation_is_found_where_it_is() -> None:
    column = np.where((TIMES > 3) & (TIMES < 6), FAST, 0.0) + TIMES
    (swing,) = oscillations(TIMES, column, slower_than=0.5)
    assert (swing.start, swing.end) == pytest.approx((3.0, 6.0), abs=0.2)
    assert swing.periods == pytest.approx((0.2, 0.2), rel=0.05)
    for points, side in ((swing.lower, -2.0), (swing.upper, 2.0)):
        middle = np.interp(4.5, *np.array(points).T[:2])
        assert middle == pytest.approx(4.5 + side, abs=0.3), "the envelope rises with the signal"


def test_lines_and_oscillations_take_turns_and_a_period_that_changes_is_told_at_both_ends() -> None:
    burst = np.where((TIMES > 3) & (TIMES < 6), FAST, 0.0)
    text = course(TIMES, burst, clock=1, tolerance=0.08, slower_than=0.5)
    before, swing, after = text.split("; ")
    assert before.startswith("0:0 3:0") and after.endswith(" 10:0")
    assert swing.startswith("swings from 3.1 to 6 s with period 0.2 s, between 3.1:-2 ")
    slowing = np.where(TIMES < 6, 2 * np.sin(2 * np.pi * 2 * TIMES), FAST)
    told = course(TIMES, slowing, clock=1, tolerance=0.08, slower_than=1.0)
    assert " s with period 0.5 s, at the end 0.2 s, between" in told


def test_slow_signals_and_ripple_do_not_oscillate() -> None:
    assert oscillations(TIMES, np.sin(2 * np.pi * TIMES / 5), slower_than=0.5) == []
    assert oscillations(TIMES, 100 * TIMES + 0.1 * np.sin(60 * TIMES), slower_than=0.5) == []
    assert oscillations(TIMES, TIMES + 0.15 * np.sin(4 * np.pi * TIMES), slower_than=2.0) == []


@pytest.mark.parametrize("periods", [3.3, 6])
def test_a_period_is_the_time_between_two_peaks_however_fast_a_signal_falls(periods: float) -> None:
    phase = TIMES / 0.4 % 1
    saw = np.where(phase < 0.9, phase / 0.9, 10 * (1 - phase)) * (periods * 0.4 > TIMES)
    (swing,) = oscillations(TIMES, saw, slower_than=2.0)
    assert swing.periods == pytest.approx((0.4, 0.4))


def test_digits_follow_the_margin() -> None:
    pressure = np.array([87.0, 87.463, 90.0])
    assert column_decimals(pressure) == 2
    assert column_decimals(pressure, margin=0.037) == 4
    assert column_decimals(pressure, margin=1e-30) <= 8
    assert column_decimals(1e6 + 1e-4 * pressure) == 5, "else all of them read as one"
