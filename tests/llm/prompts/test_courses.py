from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.llm.prompts.courses import (
    change_list,
    column_decimals,
    dwell_list,
    extrema,
    is_discrete,
    longest_stretch,
    oscillation,
    pieces,
    samples_at,
)

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
        "4: entered at 7 s and kept to the end",
    ]
    assert "1: never entered again" in dwell_list(TIMES, steps((0, 1), (2, 2)), clock=2)


def test_pieces_cover_everything() -> None:
    found = pieces(TIMES, GEAR)
    assert [p.value for p in found] == [1, 2, 3, 2, 1, 4]
    assert found[0].start == 0 and found[-1].end == 10
    assert all(a.end == b.start for a, b in pairwise(found))


def test_extrema() -> None:
    column = np.sin(TIMES)
    assert extrema(TIMES, column, decimals=3, clock=2) == "min -1 at 4.71 s, max 1 at 1.57 s"
    assert extrema(TIMES, 0 * column + 30, decimals=3, clock=2) == "constant 30"


def test_longest_stretch() -> None:
    assert longest_stretch(TIMES, GEAR == 2) == pytest.approx((1.6, 4.35))
    assert longest_stretch(TIMES, GEAR == 7) is None
    assert longest_stretch(TIMES, GEAR > 0) == (0, 10)


def test_a_fast_oscillation_is_found_where_it_is() -> None:
    column = np.where((TIMES > 3) & (TIMES < 6), 2 * np.sin(2 * np.pi * 5 * TIMES), 0.0) + TIMES
    found = oscillation(TIMES, column, slower_than=0.5)
    assert found is not None
    assert found.period == pytest.approx(0.2, rel=0.05)
    assert found.start == pytest.approx(3.0, abs=0.2)
    assert found.end == pytest.approx(6.0, abs=0.2)
    assert found.swing == pytest.approx(4.0, rel=0.05)


def test_slow_signals_and_ripple_do_not_oscillate() -> None:
    slow = np.sin(2 * np.pi * TIMES / 5)
    assert oscillation(TIMES, slow, slower_than=0.5) is None
    assert oscillation(TIMES, 100 * TIMES + 0.1 * np.sin(60 * TIMES), slower_than=0.5) is None


def test_discrete_by_type_or_by_values() -> None:
    assert is_discrete(GEAR, kind="real")
    assert is_discrete(np.zeros(5), kind="boolean")
    assert not is_discrete(np.zeros(5), kind="real")
    assert not is_discrete(TIMES, kind="real")
    assert not is_discrete(np.arange(50.0), kind="real")


def test_digits_follow_the_margin() -> None:
    pressure = np.array([87.0, 87.463, 90.0])
    assert column_decimals(pressure) == 2
    assert column_decimals(pressure, margin=0.037) == 4
    assert column_decimals(pressure, margin=1e-30) <= 8
    assert samples_at(np.array([0.0, 1.0, 2.0]), pressure, [1.1], decimals=3) == "87.463"
