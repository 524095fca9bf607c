import gc
import threading

import numpy as np

from falsifier.engines import make_engine
from falsifier.evaluation.evaluate import Evaluation
from tests.engines.support import NamedEngine, assert_batch_differs, best_of, bowl, box_problem
from tests.patience import HANG


class TestContract(NamedEngine):
    engine = "annealing"


def test_it_gets_deeper_than_a_few_random_points() -> None:
    assert best_of("annealing", simulations=150) < best_of("uniform", simulations=10)


def test_parallel_candidates_differ() -> None:
    assert_batch_differs("annealing")


def test_it_goes_one_step_at_a_time_and_bridges_the_wait_with_random_points() -> None:
    problem = box_problem()
    engine = make_engine("annealing", problem, seed=0)
    first, second = engine.ask(2)
    assert (first.rationale, second.rationale) == (
        "a step of simulated annealing",
        "uniform random, while annealing waits",
    )
    engine.tell([bowl(problem, second)])
    assert engine.ask()[0].rationale == "uniform random, while annealing waits"
    engine.tell([Evaluation(first, "failed", reason="diverged")])
    assert engine.ask()[0].rationale == "a step of simulated annealing"


def test_an_engine_that_nobody_holds_any_more_ends_its_thread() -> None:
    before = set(threading.enumerate())
    engine = make_engine("annealing", box_problem(), seed=0)
    assert np.isfinite(engine.ask()[0].parameters["x0"])
    (thread,) = set(threading.enumerate()) - before
    assert thread.name == "annealing"
    del engine
    gc.collect()
    thread.join(HANG)
    assert not thread.is_alive()
