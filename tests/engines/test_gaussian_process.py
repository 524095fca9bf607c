import numpy as np
import pytest

from falsifier.engines.gaussian_process import GaussianProcess, distances, fit_lengths, matern, standardised


def test_process_interpolates_and_is_unsure_far_away() -> None:
    points = np.linspace(0, 1, 9)[:, None]
    targets = np.sin(5 * points[:, 0])
    process = fit_lengths(points, targets, np.array([0.3]), np.random.default_rng(0), noise=1e-6)
    mean, deviation = process.predict(np.array([[0.5], [0.44], [3.0]]))
    assert mean[0] == pytest.approx(np.sin(2.5), abs=1e-3)
    assert mean[1] == pytest.approx(np.sin(2.2), abs=0.05)
    assert deviation[0] < 0.01 and deviation[2] > 0.5


def test_evidence_prefers_the_right_length_scale() -> None:
    rng = np.random.default_rng(1)
    points = rng.random((40, 2))
    targets = np.sin(9 * points[:, 0])
    along, across = (
        GaussianProcess.fit(points, targets, np.array(lengths), noise=1e-4).evidence
        for lengths in ([0.4, 5.0], [5.0, 0.4])
    )
    assert along > across


def test_one_huge_cost_does_not_hide_small_differences() -> None:
    targets = standardised(np.array([1.0, 1.1, 1.2, 1e9]))
    assert np.diff(targets).min() > 0.1


def test_correlation_falls_from_one_with_the_distance() -> None:
    found = matern(np.array([0.0, 0.5, 1.0, 2.0, 50.0]))
    assert found[0] == 1.0
    assert (np.diff(found) < 0).all()
    assert found[-1] == pytest.approx(0.0, abs=1e-12)


def test_distances_are_euclidean() -> None:
    x, z = np.random.default_rng(0).random((2, 4, 3))
    expected = np.linalg.norm(x[:, None] - z[None], axis=2)
    np.testing.assert_allclose(distances(x, z), expected, atol=1e-12)
    assert distances(x, x).diagonal() == pytest.approx(np.zeros(4), abs=1e-7)


def test_equal_costs_are_no_trouble() -> None:
    assert np.isfinite(standardised(np.full(5, 3.0))).all()
    assert np.isfinite(standardised(np.array([2.0]))).all()


@pytest.mark.parametrize("seed", range(8))
def test_length_scales_that_shrink_from_fit_to_fit_leave_a_covariance_that_can_be_factored(seed: int) -> None:
    """Found in a long search: after many refits the factor of the covariance did not exist."""
    rng = np.random.default_rng(seed)
    apart = 10.0 ** -rng.uniform(3, 12) * rng.standard_normal((80, 8))
    points = rng.random((5, 8))[rng.integers(0, 5, 80)] + apart
    process = fit_lengths(points, rng.standard_normal(80), np.full(8, 1e-8), rng, noise=1e-4)
    assert np.isfinite(process.weights).all()
