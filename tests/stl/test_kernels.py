"""Each compiled loop against the plainest way of writing it down."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.stl import kernels
from falsifier.stl import opcodes as op

Floats = NDArray[np.float64]
A = np.array([3.0, -1.0, 4.0, 1.5, -5.0, 9.0, 2.0, 6.0])
B = np.array([2.0, 2.0, 0.5, 3.0, 1.0, 1.0, -2.0, 0.5])


def run(
    code: int, *, length: int = 8, width: int = 0, a: Floats = A, p: float = 0.0, q: float = 0.0
) -> Floats:
    """One step on the signals a and b."""
    buffer = np.concatenate([a, B, np.full(length, np.nan)])
    row = np.array([[code, len(a) + len(B), 0, len(a), length, width]])
    status, _ = kernels.judge(row, np.array([[p, q]]), buffer, len(a) + len(B), np.arange(3.0), 1.0)
    assert status == kernels.FINE
    return buffer[len(a) + len(B) :]


@pytest.mark.parametrize(
    ("code", "plain"),
    [
        (op.ADD, np.add),
        (op.SUBTRACT, np.subtract),
        (op.MULTIPLY, np.multiply),
        (op.DIVIDE, np.divide),
        (op.MINIMUM, np.minimum),
        (op.MAXIMUM, np.maximum),
    ],
)
def test_arithmetic(code: int, plain: Callable[[Floats, Floats], Floats]) -> None:
    np.testing.assert_array_equal(run(code), plain(A, B))


def test_powers() -> None:
    np.testing.assert_allclose(run(op.POWER, a=np.abs(A)), np.abs(A) ** B)


@pytest.mark.parametrize(
    ("code", "plain"),
    [
        (op.ABS, np.abs),
        (op.SQRT, np.sqrt),
        (op.EXP, np.exp),
        (op.LOG, np.log),
        (op.SIN, np.sin),
        (op.COS, np.cos),
    ],
)
def test_functions(code: int, plain: Callable[[Floats], Floats]) -> None:
    np.testing.assert_allclose(run(code, a=np.abs(A)), plain(np.abs(A)), rtol=1e-15)


def test_scaling_and_constants() -> None:
    np.testing.assert_array_equal(run(op.SCALE, p=-2.0, q=0.5), -2.0 * A + 0.5)
    np.testing.assert_array_equal(run(op.FILL, q=7.0), np.full(8, 7.0))


@pytest.mark.parametrize("samples", [1, 2, 3, 8, 50])
@pytest.mark.parametrize("width", [0, 1, 2, 5, 49])
def test_sliding_extremes_of_every_width(samples: int, width: int) -> None:
    a = np.random.default_rng(samples * 100 + width).integers(-5, 6, samples + width).astype(np.float64)
    windows = np.lib.stride_tricks.sliding_window_view(a, width + 1)
    np.testing.assert_array_equal(
        run(op.WINDOW_MINIMUM, length=samples, width=width, a=a), windows.min(axis=1)
    )
    np.testing.assert_array_equal(
        run(op.WINDOW_MAXIMUM, length=samples, width=width, a=a), windows.max(axis=1)
    )


def test_extremes_of_all_that_follows() -> None:
    np.testing.assert_array_equal(run(op.REST_MINIMUM), np.minimum.accumulate(A[::-1])[::-1])
    np.testing.assert_array_equal(run(op.REST_MAXIMUM), np.maximum.accumulate(A[::-1])[::-1])


def test_until_is_its_definition() -> None:
    expected = [max(min([B[j], *A[i:j]]) for j in range(i, 8)) for i in range(8)]
    np.testing.assert_array_equal(run(op.UNTIL), expected)


def test_a_program_that_leaves_the_numbers_stops_at_its_check() -> None:
    a = np.array([1.0, 0.0])
    rows = np.array([[op.LOG, 2, 0, 0, 2, 0], [op.CHECK, 0, 2, 0, 2, 0], [op.FILL, 4, 0, 0, 1, 0]])
    buffer = np.concatenate([a, np.zeros(3)])
    status, where = kernels.judge(rows, np.full((3, 2), 9.0), buffer, 2, np.arange(2.0), 1.0)
    assert (status, where) == (kernels.BAD_STEP, 1)
    assert buffer[4] == 0.0, "what comes after is not done"


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_signals_that_are_no_numbers_are_found(bad: float) -> None:
    buffer = np.array([1.0, 2.0, bad, 4.0])
    empty = np.zeros((0, 6), dtype=np.int64)
    status, where = kernels.judge(empty, np.zeros((0, 2)), buffer, 4, np.arange(2.0), 1.0)
    assert (status, where) == (kernels.BAD_SIGNAL, 2)


@pytest.mark.parametrize(("times", "late"), [([0.0, 1.0, 2.1], 2), ([0.5, 1.5], 0), ([0.0, np.nan], 1)])
def test_an_uneven_grid_is_found(times: list[float], late: int) -> None:
    empty = np.zeros((0, 6), dtype=np.int64)
    found = kernels.judge(empty, np.zeros((0, 2)), np.zeros(1), 0, np.array(times), 1.0)
    assert found == (kernels.BAD_TIME, late)


def test_many_trajectories_are_judged_one_by_one() -> None:
    rows = np.array([[op.SUBTRACT, 4, 0, 2, 1, 0]])
    columns = np.array([[[1.0, 0.0], [5.0, 0.0], [np.nan, 0.0]], [[2.0, 0.0], [3.0, 0.0], [1.0, 0.0]]])
    result = np.empty(2)
    arguments = (rows, np.zeros((1, 2)), np.empty(5))
    assert kernels.judge_many(*arguments, columns[:, :2], 4, result) == (kernels.FINE, 0, 0)
    assert result.tolist() == [-1.0, 2.0]
    assert kernels.judge_many(*arguments, columns, 4, np.empty(3)) == (kernels.BAD_SIGNAL, 2, 0)
