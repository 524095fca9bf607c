from dataclasses import replace

from falsifier.core.space import InputRange, SearchSpace
from falsifier.search.assurance.distribution import distribution_text
from falsifier.testing import FREE, START, lag_problem


def test_each_input_and_parameter_is_described_with_its_range_and_unit() -> None:
    text = distribution_text(lag_problem(points=5, parameters=[START]).space)
    assert "u with 5 control points 2.5 s apart, linear, each uniform in [-1, 1] V" in text
    assert "x0 uniform in [-1, 1]" in text
    assert "other control points" not in text


def test_what_a_free_space_allows_beyond_the_draws_is_said() -> None:
    assert "other control points, which a search may try, are not drawn" in distribution_text(
        lag_problem(free=FREE).space
    )


def test_constants_held_and_whole_numbers_are_named() -> None:
    gear = InputRange("gear", 1, 4, kind="integer")
    held = InputRange("u", 0, 1, control_points=3, hold=0.5)
    text = distribution_text(SearchSpace((gear, replace(held, interpolation="pchip")), (), 10.0))
    assert "gear constant, uniform in [1, 4], rounded to an allowed number" in text
    assert "u with 3 control points 5 s apart, pchip, held for 0.5 s" in text
