from hypothesis import given
from hypothesis import strategies as st

from falsifier.llm.prompts.numbers import bounds, runs

floats = st.floats(-1e6, 1e6, allow_nan=False)


@given(floats, st.floats(1e-3, 1e6))
def test_printed_bounds_lie_inside_the_range(low: float, width: float) -> None:
    high = low + width
    printed_low, printed_high = (float(text) for text in bounds(low, high))
    assert low <= printed_low <= printed_high <= high


def test_runs_read_back() -> None:
    assert runs([1.0] * 20 + [2.0]) == '["1 x 20", 2]'
    assert runs([1.0] * 10) == f"[{', '.join(['1'] * 10)}]"
