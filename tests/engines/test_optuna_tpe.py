import pytest

from falsifier.engines import make_engine
from falsifier.evaluation.evaluate import Evaluation
from tests.engines.support import (
    NamedEngine,
    assert_batch_differs,
    assert_batch_spreads,
    assert_learns,
    bowl,
    box_problem,
)


class TestContract(NamedEngine):
    engine = "optuna"


def test_it_goes_down_a_bowl() -> None:
    assert_learns("optuna", simulations=80)


def test_parallel_candidates_differ() -> None:
    assert_batch_differs("optuna")


def test_a_batch_spreads_around_a_known_valley() -> None:
    assert_batch_spreads("optuna")


def test_it_learns_from_candidates_of_others() -> None:
    problem = box_problem()
    alone, taught = (make_engine("optuna", problem, seed=1) for _ in range(2))
    for candidate in make_engine("sobol", problem, seed=5).ask(60):
        taught.tell([bowl(problem, candidate)])
    found = [min(bowl(problem, c).robustness or 9.0 for c in engine.ask(5)) for engine in (taught, alone)]
    assert found[0] < found[1]


def test_it_announces_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    engine = make_engine("optuna", box_problem(), seed=1)
    engine.tell([Evaluation(c, "failed") for c in engine.ask(2)])
    assert capfd.readouterr() == ("", "")
