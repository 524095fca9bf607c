"""Each step against the plainest way of writing it down."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.stl import steps

Floats = NDArray[np.float64]
A = np.array([3.0, -1.0, 4.0, 1.5, -5.0, 9.0, 2.0, 6.0])
B = np.array([2.0, 2.0, 0.5, 3.0, 1.0, 1.0, -2.0, 0.5])


def run(make: steps.Maker, *, length: int = 8, a: Floats = A, p: float = 0.0, q: float = 0.0) -> Floats:
    """One step on the signals a and b; on two trajectories at once, the first one comes out alike."""
    size = len(a) + len(B)
    step = make(slice(size, size + length), slice(0, len(a)), slice(len(a), size), p, q)
    one = np.concatenate([a, B, np.full(length, np.nan)])
    two = np.stack([one, one[::-1]], axis=1)
    assert steps.run((step,), one) == steps.run((step,), two) == -1
    np.testing.assert_array_equal(two[:, 0], one)
    return one[size:]


@pytest.mark.parametrize(
    ("make", "plain"),
    [
        (steps.ADD, np.add),
        (steps.SUBTRACT, np.subtract),
        (steps.MULTIPLY, np.multiply),
        (steps.DIVIDE, np.divide),
        (steps.MINIMUM, np.minimum),
        (steps.MAXIMUM, np.maximum),
        (steps.POWER, np.power),
    ],
)
def test_arithmetic(make: steps.Maker, plain: Callable[[Floats, Floats], Floats]) -> None:
    np.testing.assert_array_equal(run(make, a=np.abs(A)), plain(np.abs(A), B))


def test_functions_scaling_and_constants() -> None:
    np.testing.assert_array_equal(run(steps.LOG, a=np.abs(A)), np.log(np.abs(A)))
    np.testing.assert_array_equal(run(steps.SCALE, p=-2.0, q=0.5), -2.0 * A + 0.5)
    np.testing.assert_array_equal(run(steps.FILL, q=7.0), np.full(8, 7.0))


@pytest.mark.parametrize("samples", [1, 2, 3, 8, 50])
@pytest.mark.parametrize("width", [0, 1, 2, 5, 49])
def test_sliding_extremes_of_every_width(samples: int, width: int) -> None:
    a = np.random.default_rng(samples * 100 + width).integers(-5, 6, samples + width).astype(np.float64)
    windows = np.lib.stride_tricks.sliding_window_view(a, width + 1)
    np.testing.assert_array_equal(run(steps.WINDOW_MINIMUM, length=samples, a=a), windows.min(axis=1))
    np.testing.assert_array_equal(run(steps.WINDOW_MAXIMUM, length=samples, a=a), windows.max(axis=1))


def test_extremes_of_all_that_follows() -> None:
    np.testing.assert_array_equal(run(steps.REST_MINIMUM), np.minimum.accumulate(A[::-1])[::-1])
    np.testing.assert_array_equal(run(steps.REST_MAXIMUM), np.maximum.accumulate(A[::-1])[::-1])


@pytest.mark.parametrize("seed", range(5))
def test_until_is_its_definition(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a = A if seed == 0 else rng.integers(-4, 5, 8).astype(np.float64)
    expected = [max(min([B[j], *a[i:j]]) for j in range(i, 8)) for i in range(8)]
    np.testing.assert_array_equal(run(steps.UNTIL, a=a), expected)


def test_steps_that_leave_the_numbers_stop_at_their_check() -> None:
    here, there, last = slice(0, 2), slice(2, 4), slice(4, 5)
    made = (
        steps.LOG(there, here, here, 0.0, 0.0),
        steps.CHECK(there, there, there, 9.0, 0.0),
        steps.FILL(last, here, here, 0.0, 9.0),
    )
    buffer = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    assert steps.run(made, buffer) == 1
    assert buffer[2] == 9.0, "on the limit"
    assert buffer[4] == 0.0, "what comes after is not done"
    buffer = np.array([1.0, 1.0, 0.0, 0.0, 0.0])
    assert steps.run(made, buffer) == -1
    assert buffer[4] == 9.0
