from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.llm.prompts.courses import (
    change_list,
    coarse_clock,
    column_decimals,
    course_text,
    dwell_list,
    longest_stretch,
    pieces,
)
from falsifier.llm.prompts.shapes import Course, Phase, Swing

TIMES = np.linspace(0.0, 10.0, 1001)


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


def test_a_course_is_told_by_its_breakpoints_and_oscillations() -> None:
    flat = Course((((0.0, 1.0), (0.04, 1.0), (2.5, 3.04)),), (), 0.1)
    assert course_text(flat, decimals=1, clock=1) == "0:1 2.5:3", "what reads the same is told once"
    swing = Swing(3.0, 6.0, (Phase(3.0, 0.2), Phase(5.0, 0.4)), ((3.0, -1.0),), ((6.0, 1.0),))
    drawn = Course((((0.0, 0.0), (3.0, 0.0)),), (swing,), 0.1)
    assert course_text(drawn, decimals=0, clock=0) == (
        "0:0 3:0; oscillates from 3 to 6 s with period 0.2 s, 0.4 s from 5 s, between 3:-1 and 6:1"
    )


def test_digits_follow_the_margin() -> None:
    pressure = np.array([87.0, 87.463, 90.0])
    assert column_decimals(pressure) == 2
    assert column_decimals(pressure, margin=0.037) == 4
    assert column_decimals(pressure, margin=1e-30) <= 8


def test_times_of_a_course_show_a_hundredth_of_the_simulation() -> None:
    assert [coarse_clock(stop) for stop in (1000.0, 50.0, 3.0, 0.3)] == [0, 1, 2, 3]


def test_two_breakpoints_never_have_the_same_time() -> None:
    drawn = Course((((0.0, 1.0), (0.11, 2.0), (0.12, 3.0)),), (), 0.1)
    assert course_text(drawn, decimals=0, clock=1) == "0:1 0.11:2 0.12:3"
