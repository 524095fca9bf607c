import pytest

from falsifier.engines import make_engine
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.stl import Verdict
from falsifier.testing import drive, lag_problem
from tests.engines.support import NamedEngine, assert_batch_differs, assert_learns, bowl, box_problem


class TestContract(NamedEngine):
    engine = "cma"


def test_it_goes_down_a_bowl() -> None:
    assert_learns("cma", simulations=150)


def test_parallel_candidates_differ() -> None:
    assert_batch_differs("cma")


def test_a_generation_is_complete_before_the_next_one_and_the_wait_is_bridged() -> None:
    problem = box_problem()
    engine = make_engine("cma", problem, seed=0)
    asked = engine.ask(20)
    own = [c for c in asked if c.rationale.startswith("generation 1 ")]
    assert [c.rationale for c in asked[len(own) :]] == ["uniform random, while a generation is simulated"] * (
        20 - len(own)
    )
    engine.tell([bowl(problem, c) for c in own[:-1]])
    assert not engine.ask()[0].rationale.startswith("generation")
    engine.tell([Evaluation(own[-1], "failed", reason="diverged")])
    assert engine.ask()[0].rationale.startswith("generation 2 ")


def test_it_restarts_on_a_plateau() -> None:
    problem = box_problem()
    engine = make_engine("cma", problem, seed=0)
    generations = set()
    for _ in range(100):
        (candidate,) = engine.ask()
        generations.add(int(candidate.rationale.split()[1]))
        flat = Evaluation(candidate, verdict=Verdict(1.0, 0.0, "flat"))
        engine.tell([flat])
    assert generations == {1}, "a plateau ends a start after its first generation"


def test_a_single_coordinate_can_be_searched() -> None:
    problem = lag_problem(points=1)
    engine = make_engine("cma", problem, seed=0)
    values = [c.signals["u"].values[0] for c in drive(engine, lambda c: evaluate(problem, c), rounds=40)]
    assert max(values) == pytest.approx(1.0, abs=0.1), "x is highest where u is"


def test_it_is_told_of_others_candidates_after_a_generation_is_complete() -> None:
    problem = box_problem()
    engine, other = (make_engine("cma", problem, seed=s) for s in (0, 1))
    own = [c for c in engine.ask(20) if c.rationale.startswith("generation 1 ")]
    engine.tell([bowl(problem, c) for c in own])
    engine.tell([bowl(problem, c) for c in other.ask(2)])
    assert engine.ask()[0].rationale.startswith("generation 2 ")
