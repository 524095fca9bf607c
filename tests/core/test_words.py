"""Numbers in words."""

import pytest
from hypothesis import given, strategies as st

from falsifier.core.words import ends, readable


@given(st.floats(-1e12, 1e12), st.floats(1e-9, 1.0))
def test_both_ends_of_a_range_are_told_within_a_hundredth_of_it(low: float, width: float) -> None:
    if (high := low + width) > low:
        told = [float(text) for text in ends(low, high)]
        assert told == pytest.approx([low, high], rel=0, abs=0.01 * (high - low))


def test_a_number_with_all_its_digits_is_the_shortest_text_of_it() -> None:
    assert readable(0.1 + 0.2, 17) == "0.30000000000000004"
    assert readable(1000000.0009, 17, "+") == "+1000000.0009"
    assert readable(1e12, 17) == "1000000000000"
