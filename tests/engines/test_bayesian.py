import numpy as np
import pytest
from scipy.stats import norm

from falsifier.engines.bayesian import log_improvement
from tests.engines.support import NamedEngine, assert_batch_differs, assert_learns


class TestContract(NamedEngine):
    engine = "bayesian"


def test_it_goes_down_a_bowl() -> None:
    assert_learns("bayesian", simulations=40)


def test_parallel_candidates_differ() -> None:
    assert_batch_differs("bayesian")


def test_log_improvement_is_the_logarithm_and_finite_where_that_underflows() -> None:
    z = np.array([-8.0, -4.0, -2.9, 0.0, 3.0])
    exact = np.log(norm.pdf(z[1:]) + z[1:] * norm.cdf(z[1:]))
    values = log_improvement(-z, np.ones(5), 0.0)
    assert values[1:] == pytest.approx(exact, abs=1e-6)
    far = log_improvement(np.array([20.0, 40.0, 400.0]), np.ones(3), 0.0)
    assert np.isfinite(far).all() and (np.diff(far) < 0).all()
