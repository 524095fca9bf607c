from tests.engines.support import NamedEngine, assert_batch_differs, assert_batch_spreads, assert_learns


class TestContract(NamedEngine):
    engine = "optuna"


def test_it_goes_down_a_bowl() -> None:
    assert_learns("optuna", simulations=80)


def test_parallel_candidates_differ() -> None:
    assert_batch_differs("optuna")


def test_a_batch_spreads_around_a_known_valley() -> None:
    assert_batch_spreads("optuna")
