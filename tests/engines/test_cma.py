from tests.engines.support import NamedEngine, assert_batch_differs, assert_learns


class TestContract(NamedEngine):
    engine = "cma"


def test_it_goes_down_a_bowl() -> None:
    assert_learns("cma", simulations=150)


def test_parallel_candidates_differ() -> None:
    assert_batch_differs("cma")
