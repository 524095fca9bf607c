import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from falsifier.core.signals import Signal, even_times

GRID = np.linspace(0, 50, 5001)


def test_pchip_is_scipys() -> None:
    values = [10.0, 80, 20, 60, 100, 0, 50]
    expected = PchipInterpolator(np.linspace(0, 50, 7), values)(GRID)
    np.testing.assert_allclose(Signal.evenly(values, stop_time=50).sample(GRID), expected, atol=1e-12)


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=9), st.data())
def test_pchip_is_scipys_at_uneven_times(values: list[float], data: st.DataObject) -> None:
    gaps = data.draw(st.lists(st.floats(0.1, 9), min_size=len(values) - 1, max_size=len(values) - 1))
    times = np.concatenate([[0.0], np.cumsum(gaps)]).astype(np.float64)
    at = np.linspace(0.0, float(times[-1]), 57)
    got = Signal(tuple(times.tolist()), tuple(values)).sample(at)
    np.testing.assert_allclose(got, PchipInterpolator(times, values)(at), atol=1e-9)


def test_constant_pieces_are_equally_long_and_right_continuous() -> None:
    signal = Signal.evenly([1, 2, 3, 4], stop_time=8, interpolation="constant")
    assert signal.times == (0, 2, 4, 6)
    assert signal.sample(np.array([0, 1.99, 2, 3.5, 4, 6, 8])).tolist() == [1, 1, 2, 2, 3, 4, 4]


def test_linear_keeps_its_last_value() -> None:
    signal = Signal((0.0, 1.0), (0.0, 10.0), "linear")
    assert signal.sample(np.array([0.0, 0.25, 1.0, 7.0])).tolist() == [0, 2.5, 10, 10]


def test_hold_samples_at_its_own_multiples_in_spite_of_rounding() -> None:
    signal = Signal((0.0, 1.0), (0.0, 1.0), "linear", hold=0.05)
    times = np.linspace(0.0, 0.2, 21)
    expected = np.repeat([0.0, 0.05, 0.10, 0.15, 0.20], 5)[:21]
    np.testing.assert_allclose(signal.sample(times), expected, atol=1e-12)


def test_one_point_is_a_constant() -> None:
    assert set(Signal.evenly([3.5], stop_time=10).sample(GRID)) == {3.5}
    assert even_times(1, stop_time=10, interpolation="pchip") == (0.0,)


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ((0.0, 1.0), (1.0,), "equally many"),
        ((1.0, 2.0), (1.0, 2.0), "strictly from 0"),
        ((0.0, 0.0), (1.0, 2.0), "strictly from 0"),
        ((0.0, 1.0), (1.0, float("nan")), "finite"),
        ((), (), "one or more"),
    ],
)
def test_bad_control_points_are_refused(
    times: tuple[float, ...], values: tuple[float, ...], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Signal(times, values)


def test_switches_and_dwell() -> None:
    signal = Signal((0.0, 1.0, 1.5, 4.0), (0.0, 1.0, 0.0, 0.0), "constant")
    assert signal.switches == 2
    assert signal.shortest_dwell == 0.5
    assert Signal((0.0,), (1.0,)).shortest_dwell is None
