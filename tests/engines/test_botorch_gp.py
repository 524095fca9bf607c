import pytest

from tests.engines.support import (
    NamedEngine,
    assert_batch_differs,
    assert_batch_spreads,
    assert_learns,
    needs_botorch,
)


@pytest.fixture(autouse=True)
def installed() -> None:
    needs_botorch()


class TestContract(NamedEngine):
    engine = "botorch"
    # Enough to get beyond the Sobol points, which are twice the coordinates and two.
    rounds = 15


def test_it_goes_down_a_bowl() -> None:
    assert_learns("botorch", simulations=30)


def test_parallel_candidates_differ() -> None:
    assert_batch_differs("botorch")


def test_a_batch_spreads_around_a_known_valley() -> None:
    assert_batch_spreads("botorch")
