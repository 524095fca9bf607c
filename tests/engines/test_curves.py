import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from falsifier.engines.curves import read_curves


@pytest.mark.parametrize("count", [2, 3, 8])
def test_curves_are_those_of_scipy(count: int) -> None:
    rng = np.random.default_rng(count)
    knots = np.cumsum(rng.uniform(0.5, 2.0, count))
    # Levels that often repeat: flat pieces, peaks and valleys.
    values = rng.integers(0, 4, (50, count)) / 3.0
    at = np.append(np.linspace(knots[0], knots[-1], 40), knots)
    np.testing.assert_allclose(
        read_curves(knots, values, at), PchipInterpolator(knots, values, axis=1)(at), atol=1e-12
    )
