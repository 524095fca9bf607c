from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.fmu.integrators import _A, _C, _E, _GAMMA, _IA, _IB, _IC, _IE


def order_residuals(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], order: int
) -> float:
    """Largest residual of the Runge-Kutta order conditions (Hairer, Norsett, Wanner I, table II.2.2)."""
    ac = a @ c
    conditions: list[list[tuple[Any, float]]] = [
        [(b.sum(), 1)],
        [(b @ c, 1 / 2)],
        [(b @ c**2, 1 / 3), (b @ ac, 1 / 6)],
        [(b @ c**3, 1 / 4), (b @ (c * ac), 1 / 8), (b @ a @ c**2, 1 / 12), (b @ a @ ac, 1 / 24)],
        [
            (b @ c**4, 1 / 5),
            (b @ (c**2 * ac), 1 / 10),
            (b @ ac**2, 1 / 20),
            (b @ (c * (a @ c**2)), 1 / 15),
            (b @ (c * (a @ ac)), 1 / 30),
            (b @ a @ c**3, 1 / 20),
            (b @ a @ (c * ac), 1 / 40),
            (b @ a @ a @ c**2, 1 / 60),
            (b @ a @ a @ ac, 1 / 120),
        ],
    ]
    return max(abs(float(value) - exact) for group in conditions[:order] for value, exact in group)


def test_coefficients_have_their_orders() -> None:
    explicit = np.hstack([_A, np.zeros((7, 1))])
    b = explicit[6]
    assert order_residuals(explicit, b, _C, 5) < 1e-14
    assert order_residuals(explicit, b - _E, _C, 4) < 1e-14
    implicit = np.hstack([_IA, np.zeros((6, 1))]) + np.diag([0.0] + [_GAMMA] * 5)
    assert order_residuals(implicit, _IB, _IC, 4) < 1e-14
    assert order_residuals(implicit, _IB - _IE, _IC, 3) < 1e-14
    np.testing.assert_allclose(implicit.sum(axis=1), _IC, atol=1e-15)
